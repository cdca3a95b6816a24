//! What a long fit is doing, for whoever waits for it.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A part of a fit, and how far it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Doing {
    /// In words: "axis z: model search, step 3".
    pub what: String,
    /// Models, folds or draws that are done, of `of`.
    pub done: usize,
    /// How many there are in this part.
    pub of: usize,
}

type Watcher = Arc<dyn Fn(&Doing) + Send + Sync>;

/// Tells a watcher what a fit is doing, from any thread. It changes no result.
#[derive(Clone, Default)]
pub struct Progress {
    watcher: Option<Watcher>,
    /// Before every part: the axis.
    of: String,
}

impl Progress {
    /// Tells `watcher`.
    pub fn to(watcher: impl Fn(&Doing) + Send + Sync + 'static) -> Self {
        Self { watcher: Some(Arc::new(watcher)), of: String::new() }
    }

    pub(crate) fn of_axis(&self, axis: char) -> Self {
        Self { watcher: self.watcher.clone(), of: format!("axis {axis}: ") }
    }

    /// A part with so many steps; [`FitPart::one_more`] after each.
    pub(crate) fn part(&self, what: impl fmt::Display, of: usize) -> FitPart<'_> {
        let part = FitPart { progress: self, what: format!("{}{what}", self.of), of, done: AtomicUsize::new(0) };
        part.tell(0);
        part
    }
}

/// A part of a fit that is under way.
pub(crate) struct FitPart<'a> {
    progress: &'a Progress,
    what: String,
    of: usize,
    done: AtomicUsize,
}

impl FitPart<'_> {
    pub(crate) fn one_more(&self) {
        self.tell(1 + self.done.fetch_add(1, Ordering::Relaxed));
    }

    fn tell(&self, done: usize) {
        if let Some(watcher) = &self.progress.watcher {
            watcher(&Doing { what: self.what.clone(), done, of: self.of });
        }
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.watcher.is_some() { "Progress(watched)" } else { "Progress" })
    }
}
