//! Independent pieces of a computation on as many threads as there are; the results stand in the order of the items.

use std::sync::LazyLock;

/// Asked once: the answer is read from files.
static THREADS: LazyLock<usize> = LazyLock::new(|| std::thread::available_parallelism().map_or(1, usize::from));

/// Fewer items are not worth a thread.
const LEAST: usize = 4;

/// `f` of every item, in order. Threads take the items in turn, so that neighbours of unlike cost are shared out.
pub(crate) fn in_parallel<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let threads = *THREADS;
    if items.len() < LEAST || threads == 1 {
        return items.iter().map(f).collect();
    }
    let shares: Vec<Vec<R>> = std::thread::scope(|scope| {
        let f = &f;
        let one = |first: usize| scope.spawn(move || items.iter().skip(first).step_by(threads).map(f).collect());
        let running: Vec<_> = (0..threads).map(one).collect();
        let joined = running.into_iter().map(|share| match share.join() {
            Ok(results) => results,
            Err(panic) => std::panic::resume_unwind(panic),
        });
        joined.collect()
    });
    let mut shares: Vec<_> = shares.into_iter().map(Vec::into_iter).collect();
    (0..items.len()).filter_map(|index| shares[index % threads].next()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..1001).collect();
        assert_eq!(in_parallel(&items, |i| i * i), items.iter().map(|i| i * i).collect::<Vec<_>>());
        assert_eq!(in_parallel(&items[..2], |i| i + 1), [1, 2]);
    }
}
