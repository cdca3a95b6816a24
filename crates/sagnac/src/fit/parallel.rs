//! Independent pieces of a fit on as many threads as there are; the results stand in the order of the items.

/// Fewer items are not worth a thread.
const LEAST: usize = 4;

/// `f` of every item, in order.
pub(crate) fn in_parallel<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    if threads == 1 || items.len() < LEAST {
        return items.iter().map(f).collect();
    }
    let share = items.len().div_ceil(threads);
    std::thread::scope(|scope| {
        let f = &f;
        let shares: Vec<_> =
            items.chunks(share).map(|part| scope.spawn(move || part.iter().map(f).collect())).collect();
        let joined = shares.into_iter().map(|share| match share.join() {
            Ok(results) => results,
            Err(panic) => std::panic::resume_unwind(panic),
        });
        joined.flat_map(|results: Vec<R>| results).collect()
    })
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
