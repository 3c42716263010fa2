//! stub
pub struct RadarSeries {
    pub name: String,
    pub values: Vec<Option<f64>>,
}
pub struct RadarChart {
    pub title: String,
    pub subtitle: Option<String>,
    pub spokes: Vec<String>,
    pub series: Vec<RadarSeries>,
}
pub fn radar_svg(_c: &RadarChart) -> String {
    String::new()
}
