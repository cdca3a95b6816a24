//! Reports and the page of the bench in a browser, Debian's Chromium: `cargo test -p sagnac-cli --test browser`.

mod bench_page;
mod report;
mod simulate;
