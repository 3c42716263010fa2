//! The page of a run.

/// The page but for the row of what it took.
pub fn without_times(page: &str) -> String {
    page.lines().filter(|line| !line.contains("<dt>seconds</dt>")).collect::<Vec<_>>().join("\n")
}

/// The page but for what tells of the machine, which stands between two comments.
pub fn without_host(page: &str) -> String {
    let (before, rest) = page.split_once("<!-- host -->").expect("every page says what computed it");
    let (_, after) = rest.split_once("<!-- end of host -->").expect("and where that ends");
    [before, after].concat()
}
