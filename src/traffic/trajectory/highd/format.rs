//! Headers of the three highD files, with the columns in the order of the format.

/// `NN_tracks.csv`: one line per vehicle and frame.
pub(super) const TRACKS_HEADER: &str = "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,\
    frontSightDistance,backSightDistance,dhw,thw,ttc,precedingXVelocity,precedingId,followingId,leftPrecedingId,\
    leftAlongsideId,leftFollowingId,rightPrecedingId,rightAlongsideId,rightFollowingId,laneId";

/// `NN_tracksMeta.csv`: one line per vehicle.
pub(super) const TRACKS_META_HEADER: &str = "id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,\
    traveledDistance,minXVelocity,maxXVelocity,meanXVelocity,minDHW,minTHW,minTTC,numLaneChanges";

/// `NN_recordingMeta.csv`: one line. The last column is ours; only synthetic recordings have it.
pub(super) const RECORDING_META_HEADER: &str = "id,frameRate,locationId,speedLimit,month,weekDay,startTime,duration,\
    totalDrivenDistance,totalDrivenTime,numVehicles,numCars,numTrucks,upperLaneMarkings,lowerLaneMarkings,\
    synthetic";

/// Valid frame rates. Others are errors, for instance a period instead of a rate, and derived counts would overflow.
pub(super) const FRAME_RATES_HZ: std::ops::RangeInclusive<f64> = 0.1..=10_000.0;

/// Maximum number of lane lines of one carriageway; more indicates damage.
pub(super) const LANE_LINES_LIMIT: usize = 256;

/// Maximum magnitude of a frame number; it keeps differences of two frames small.
pub(super) const FRAME_LIMIT: i64 = 1_000_000_000_000;
