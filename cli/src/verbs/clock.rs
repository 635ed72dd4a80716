//! Whether times can be relied on: how much of the time that passed the flying thread had the processor.
//!
//! A thread that waits for others, or for storage, takes longer than its work. Systems other than Linux do not tell. Cost: a small file is read at the start and at the end.

use std::time::{Duration, Instant};
use terrasoar_lab::iobench::kernel::thread_time;

/// Processor time comes in hundredths of a second: of less than this no share is told.
const LEAST: Duration = Duration::from_millis(200);
/// Of a lower share, in percent, times are not reliable.
const RELIABLE_PERCENT: f64 = 80.0;

/// Runs from when it was made.
pub(super) struct Clock {
    began: Instant,
    had: Option<Duration>,
}

impl Clock {
    pub(super) fn start() -> Self {
        Self { began: Instant::now(), had: thread_time() }
    }

    /// Processor time of this thread in percent of the time that passed; `None` if it is not known, or too little time has passed.
    pub(super) fn processor_percent(&self) -> Option<f64> {
        let passed = self.began.elapsed();
        let had = thread_time()?.checked_sub(self.had?)?;
        (passed >= LEAST).then(|| (100.0 * had.as_secs_f64() / passed.as_secs_f64()).min(100.0))
    }
}

/// What is said of it.
pub(super) fn told(percent: Option<f64>) -> String {
    match percent {
        None => {
            "processor time not known: only Linux tells it, and only of flights of 0.2 seconds or more".into()
        }
        Some(percent) if percent < RELIABLE_PERCENT => {
            format!("processor time {percent:.0} % of wall time, times are not reliable")
        }
        Some(percent) => format!("processor time {percent:.0} % of wall time"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleep_is_no_work() {
        let clock = Clock::start();
        assert_eq!(clock.processor_percent(), None);
        std::thread::sleep(2 * LEAST);
        if cfg!(target_os = "linux") {
            let percent = clock.processor_percent().unwrap();
            assert!(percent < 50.0, "{percent}");
            assert!(told(Some(percent)).ends_with("not reliable"));
        }
        assert_eq!(told(Some(99.6)), "processor time 100 % of wall time");
    }
}
