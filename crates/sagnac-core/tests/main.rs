//! The tests of `sagnac-core` in one program: one compilation and one link for all of them.

mod banks;
mod conservation;
mod flash;
mod image_codec;
mod slices;
mod slow_path_exact;
mod support;
mod watch;
