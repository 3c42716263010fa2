//! What a user's mistake is answered with: one message that names the place and says what to write instead.
//!
//! The messages stand in `tests/messages/*.trycmd`, the files that provoke them in the folders beside. After a change
//! that is meant, `TRYCMD=overwrite cargo test --release --test commands messages::` writes them anew; then read the difference.

#[test]
fn mistakes_are_answered_with_place_expectation_and_remedy() {
    trycmd::TestCases::new().case("tests/messages/*.trycmd");
}
