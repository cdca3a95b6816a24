//! Ctrl-C and SIGTERM: nothing half written, and where a command says so, an orderly end first.

use std::sync::{Mutex, PoisonError};

/// Exit status after Ctrl-C, as shells have it: 128 + SIGINT.
const INTERRUPTED: i32 = 130;

type Handler = Box<dyn FnOnce() + Send>;

/// The action of the first Ctrl-C, instead of ending the program.
static FIRST: Mutex<Option<Handler>> = Mutex::new(None);

/// The first Ctrl-C does this; the next one ends the program.
#[cfg(feature = "full")]
pub(crate) fn first(act: impl FnOnce() + Send + 'static) {
    *FIRST.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(act));
}

/// Ctrl-C (and SIGTERM) ends the program with nothing half written.
pub(crate) fn leave_nothing_behind() {
    // Without a handler the program ends as well; only a temporary file may then be left.
    //
    // A file beyond the user's limit of sizes is an error of its write, and not the end of the program next to its temporary file.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
    let _ = ctrlc::set_handler(|| {
        if let Some(act) = FIRST.lock().unwrap_or_else(PoisonError::into_inner).take() {
            act();
            return;
        }
        leave();
    });
}

/// Ends the program at once, with nothing half written.
pub(crate) fn leave() -> ! {
    sagnac_log::write::remove_unfinished();
    std::process::exit(INTERRUPTED)
}
