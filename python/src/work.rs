//! Work without Python's lock, that Ctrl-C ends.
//!
//! ```text
//! caller: asks Python for signals, twenty times a second      worker: threads of its own, which a fork does not inherit half
//! ```
//!
//! A stop unwinds the worker at the next batch or step of the fit; nothing of it is kept.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use sagnac::fit::{Doing, Progress};
use sagnac_log::threads::STACK_BYTES;

use crate::errors::Ended;

/// How often the caller looks for signals.
const EACH: Duration = Duration::from_millis(50);
/// Looks for the end of work that is to stop, before the caller goes on without it.
const PATIENCE: u32 = 20;

/// The end of some work, asked for from outside it.
#[derive(Clone, Default)]
pub(crate) struct Stop {
    asked: Arc<AtomicBool>,
    raised: Arc<Mutex<Option<PyErr>>>,
}

/// What a stop unwinds with.
struct Unwound;

impl Stop {
    /// True once the work is to end.
    pub(crate) fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Ends the work with an exception of Python.
    pub(crate) fn raise(&self, raised: PyErr) {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(raised);
        self.asked.store(true, Ordering::Relaxed);
    }

    /// Tells a callable of Python what a fit does, and ends the fit where that is asked for.
    pub(crate) fn progress(&self, callback: Option<Py<PyAny>>) -> Progress {
        let stop = self.clone();
        Progress::to(move |doing| {
            if let Some(callback) = &callback
                && let Err(raised) = tell(callback, doing)
            {
                stop.raise(raised);
            }
            if stop.is_asked() {
                resume_unwind(Box::new(Unwound));
            }
        })
    }
}

fn tell(callback: &Py<PyAny>, Doing { what, done, of }: &Doing) -> PyResult<()> {
    Python::attach(|py| callback.call1(py, (what, *done, *of)).map(|_| ()))
}

/// Does some work on threads of its own, without Python's lock.
///
/// # Errors
/// What the work says; an exception of a callback; KeyboardInterrupt.
pub(crate) fn away<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Stop) -> sagnac::Result<T> + Send + 'static,
) -> PyResult<T> {
    let stop = Stop::default();
    let (sender, mut receiver) = channel();
    let of_worker = stop.clone();
    let started = sagnac_log::threads::spawn("sagnac", move || {
        // After a stop the caller may be gone.
        let _ = sender.send(done(&of_worker, work));
    });
    started.map_err(|e| {
        crate::errors::exception(sagnac::Error::input(
            format!("no thread can be started: {e}"),
            "raise the limit of threads (`ulimit -u`)",
        ))
    })?;
    let mut patience = PATIENCE;
    loop {
        // A Receiver is not shared between threads: the closure owns it while the lock is released.
        let (waited, back) = py.detach(move || (receiver.recv_timeout(EACH), receiver));
        receiver = back;
        match waited {
            Ok(done) => return done.map_err(PyErr::from),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(raised) = py.check_signals() {
                    stop.raise(raised);
                }
                // Work that has no place to stop at is not waited for: it ends by itself, and nothing is made of it.
                if stop.is_asked() {
                    patience -= 1;
                    if patience == 0 {
                        let raised = stop.raised.lock().unwrap_or_else(PoisonError::into_inner).take();
                        return Err(raised.unwrap_or_else(|| Ended::Stopped.into()));
                    }
                }
            }
            Err(RecvTimeoutError::Disconnected) => return Err(defect().into()),
        }
    }
}

fn done<T: Send>(stop: &Stop, work: impl FnOnce(&Stop) -> sagnac::Result<T> + Send) -> Result<T, Ended> {
    let pool = rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES).build();
    let pool = pool.map_err(|e| {
        sagnac::Error::input(format!("no thread can be started: {e}"), "raise the limit of threads (`ulimit -u`)")
    })?;
    let worked = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(stop))));
    if let Some(raised) = stop.raised.lock().unwrap_or_else(PoisonError::into_inner).take() {
        return Err(Ended::Raised(raised));
    }
    match worked {
        Ok(result) => Ok(result?),
        Err(unwound) => Err(ended_by(&*unwound)),
    }
}

fn ended_by(unwound: &(dyn Any + Send)) -> Ended {
    if unwound.is::<Unwound>() { Ended::Stopped } else { defect() }
}

fn defect() -> Ended {
    sagnac::Error::input(
        "a defect of this package: the work ended without a result",
        "report it with the table and the call: https://github.com/sagnac/sagnac/issues",
    )
    .into()
}
