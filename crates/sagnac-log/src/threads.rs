//! Threads that read and decode, with a stack of a stated size.
//!
//! A decoder that is not ours may go deep on a damaged file; the stack of the thread that started the program may have any size, and that
//! of another thread has 2 MiB by default. A machine may also refuse a thread (`ulimit -u`): the work then goes on without it.

use std::cell::Cell;
use std::io;
use std::thread::{Builder, JoinHandle, Scope, ScopedJoinHandle};

/// Stack of a thread that reads or decodes, bytes.
pub const STACK_BYTES: usize = 16 << 20;

thread_local! {
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Does some work whose logs are read by this thread alone: for who works on many logs at a time, one on each thread.
pub fn alone<T>(work: impl FnOnce() -> T) -> T {
    let before = IS_ALONE.replace(true);
    let done = work();
    IS_ALONE.set(before);
    done
}

/// Further threads that a log may be read with.
pub(crate) fn helpers(most: usize) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if IS_ALONE.get() { 0 } else { (cores - 1).min(most) }
}

/// The same within a scope.
///
/// # Errors
/// As [`spawn`].
pub(crate) fn spawn_in<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    work: impl FnOnce() -> T + Send + 'scope,
) -> io::Result<ScopedJoinHandle<'scope, T>> {
    Builder::new().name(name.to_owned()).stack_size(STACK_BYTES).spawn_scoped(scope, work)
}

/// Starts a thread with [`STACK_BYTES`] of stack.
///
/// # Errors
/// The machine allows no further thread.
pub fn spawn<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> io::Result<JoinHandle<T>> {
    Builder::new().name(name.to_owned()).stack_size(STACK_BYTES).spawn(work)
}
