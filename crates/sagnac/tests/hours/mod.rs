//! Studies that take hours: run by name, `cargo test -p sagnac --test studies hours:: -- --ignored`.

mod enough;
mod plan;
mod selection;
