//! Threads that read and decode, with a stack of a stated size.
//!
//! A decoder that is not ours may go deep on a damaged file; the stack of the thread that started the program may have any size, and that
//! of another thread has 2 MiB by default. A machine may also refuse a thread (`ulimit -u`): the work then goes on without it.

use std::io;
use std::thread::{Builder, JoinHandle};

/// Stack of a thread that reads or decodes, bytes.
pub const STACK_BYTES: usize = 16 << 20;

/// Starts a thread with [`STACK_BYTES`] of stack.
///
/// # Errors
/// The machine allows no further thread.
pub fn spawn<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> io::Result<JoinHandle<T>> {
    Builder::new().name(name.to_owned()).stack_size(STACK_BYTES).spawn(work)
}
