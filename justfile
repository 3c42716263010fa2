# The commands of CONTRIBUTING.md under short names; https://just.systems

# Before every commit
check:
    .ci/run lints docs

# All tests
test:
    cargo test --profile work --all-features --workspace

# The whole gate
ci:
    .ci/run

# Tests that take minutes each, before a release
long:
    .ci/long

# Alarm for lanes that became slower
bench:
    .ci/bench

# The book, an example of each page and the benchmark of rare failures as static pages, in target/site
site:
    docs/site/build
