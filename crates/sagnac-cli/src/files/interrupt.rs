//! Ctrl-C, SIGTERM and a terminal that goes away: nothing half written, and where a command says so, an orderly end first.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Exit status after Ctrl-C, as shells have it: 128 + SIGINT.
const INTERRUPTED: i32 = 130;

type Handler = Box<dyn FnOnce() + Send>;

/// The action of the first Ctrl-C, instead of ending the program.
static FIRST: Mutex<Option<Handler>> = Mutex::new(None);
/// The terminal may go away: a recording does not end with it, nor what was begun under `nohup`.
static OUTLIVES_TERMINAL: AtomicBool = AtomicBool::new(false);

/// SIGHUP does nothing from here on.
#[cfg(feature = "full")]
pub(crate) fn outlive_terminal() {
    OUTLIVES_TERMINAL.store(true, Ordering::Relaxed);
}

/// The first Ctrl-C or SIGTERM does this; the next one ends the program.
#[cfg(feature = "full")]
pub(crate) fn first(act: impl FnOnce() + Send + 'static) {
    *FIRST.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(act));
}

/// Ctrl-C, SIGTERM and SIGHUP end the program with nothing half written.
pub(crate) fn leave_nothing_behind() {
    // Without a handler the program ends as well; only a temporary file may then be left.
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
        // A file beyond the user's limit of sizes is an error of its write, and not the end of the program next to its temporary file.
        let _ = signal_hook::flag::register(SIGXFSZ, std::sync::Arc::default());
        OUTLIVES_TERMINAL.store(ignores_hangup(), Ordering::Relaxed);
        if let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP]) {
            let _ = sagnac_log::threads::spawn("signals", move || {
                signals.forever().for_each(|signal| took(signal == SIGHUP));
            });
        }
    }
}

fn took(is_hangup: bool) {
    if is_hangup && OUTLIVES_TERMINAL.load(Ordering::Relaxed) {
        return;
    }
    match FIRST.lock().unwrap_or_else(PoisonError::into_inner).take() {
        Some(act) => act(),
        None => leave(),
    }
}

/// The program was begun under `nohup`: a handler of its own would end that. Bit 0 of the mask is signal 1.
#[cfg(unix)]
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

/// Ends the program at once, with nothing half written.
pub(crate) fn leave() -> ! {
    sagnac_log::write::remove_unfinished();
    std::process::exit(INTERRUPTED)
}
