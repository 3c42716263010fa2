# Cut-ins, a row per instant; no scenario is a copy of another.
BEGIN {
    print "id,category,time_s,ego_speed_mps,ego_length_m,ego_width_m,side,target_length_m,target_width_m,target_speed_mps,target_lateral_m"
    for (id = 0; id < n; id++)
        for (k = 0; k < 20; k++)
            printf "s%d,cut-in,%.1f,%d,4.5,1.8,left,4.2,1.9,%s,%.1f\n", id, k / 10, 28 + id % 3, 20 + id / 64, 3.5 - 0.1 * k
}
