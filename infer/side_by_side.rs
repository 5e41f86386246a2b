//! Work on many items at a time.

use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::atomic::{AtomicUsize, Ordering},
    thread,
};

use anyhow::{Result, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;

/// Works on as many items as there are cores, each on its share of them, and keeps their order.
///
/// In one pool, a core that waits for its share of an item would take up another one meanwhile: more
/// and more would be under way, each with its memory, and none would be timed right.
pub fn side_by_side<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let style = "{bar:30} {pos}/{len} {elapsed_precise} (ETA {eta})";
    let style = ProgressStyle::with_template(style).expect("a valid template");
    let bar = ProgressBar::new(items.len() as u64).with_style(style);
    let n_cores = rayon::current_num_threads();
    let n_workers = n_cores.min(items.len());
    let next = AtomicUsize::new(0);
    let work_alone = || {
        let pool = ThreadPoolBuilder::new().num_threads(n_cores / n_workers).build();
        let pool = pool.expect("threads can start");
        let mut done = Vec::new();
        loop {
            let idx = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(idx) else { break done };
            done.push((idx, pool.install(|| work(item))));
            bar.inc(1);
        }
    };
    let mut done: Vec<(usize, R)> = thread::scope(|scope| {
        let workers: Vec<_> = (0..n_workers).map(|_| scope.spawn(work_alone)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no work panics")).collect()
    });
    bar.finish_and_clear();
    done.sort_by_key(|(idx, _)| *idx);
    done.into_iter().map(|(_, result)| result).collect()
}

/// A panic is an error like others: of one item, not of all.
pub fn guarded<R>(work: impl FnOnce() -> Result<R>) -> Result<R> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(anyhow!(message(&*panic))))
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    format!("panicked: {}", text.unwrap_or("without saying why"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_panic_is_one_failure() {
        let half = |&n: &usize| guarded(|| Ok(n / (n % 3)));
        let results = side_by_side(&[1, 2, 3, 4, 5], half);
        let found: Vec<_> = results.iter().map(|result| result.as_ref().ok().copied()).collect();
        assert_eq!(found, [Some(1), Some(1), None, Some(4), Some(2)]);
        let error = results[2].as_ref().unwrap_err().to_string();
        assert!(error.starts_with("panicked: attempt to"), "{error}");
    }
}
