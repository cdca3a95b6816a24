//! Errors of the library as exceptions of the package.

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::import_exception;
use pyo3::prelude::*;
use sagnac::ErrorKind;

import_exception!(sagnac._errors, InputError);
import_exception!(sagnac._errors, Refused);

/// The exception of an error: reason, place, help, each as the program prints it.
pub(crate) fn exception(error: sagnac::Error) -> PyErr {
    let place = error.place.to_string();
    let parts = (error.what, place, error.help);
    match error.kind {
        ErrorKind::Input => InputError::new_err(parts),
        ErrorKind::Refused => Refused::new_err(parts),
    }
}

/// What ended some work early.
pub(crate) enum Ended {
    /// By the library.
    Error(sagnac::Error),
    /// By an exception of Python, from a callback.
    Raised(PyErr),
    /// By the user.
    Stopped,
}

impl From<sagnac::Error> for Ended {
    fn from(error: sagnac::Error) -> Self {
        Self::Error(error)
    }
}

impl From<Ended> for PyErr {
    fn from(ended: Ended) -> Self {
        match ended {
            Ended::Error(error) => exception(error),
            Ended::Raised(raised) => raised,
            Ended::Stopped => PyKeyboardInterrupt::new_err(()),
        }
    }
}
