//! The verbs of the command line: a file or a folder for each, with its arguments, its work and its words.

pub(crate) mod allan;
#[cfg(feature = "full")]
pub(crate) mod bench;
pub(crate) mod calibrate;
pub(crate) mod compare;
pub(crate) mod compensate;
pub(crate) mod evaluate;
pub(crate) mod export;
pub(crate) mod fleet;
pub(crate) mod import;
pub(crate) mod init;
pub(crate) mod inspect;
pub(crate) mod key;
pub(crate) mod line;
pub(crate) mod manual;
pub(crate) mod plan;
pub(crate) mod simulate;
pub(crate) mod verify;
pub(crate) mod window;
