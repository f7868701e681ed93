//! Requests from outside to stop: Ctrl-C, and the signal by which farms and batch systems announce that time is up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::flag;

use crate::exit::INTERRUPTED;

/// Whether the program has been asked to stop, or to show what it has.
#[derive(Debug, Default)]
pub struct Interrupt {
    stop: Arc<AtomicBool>,
    snapshot: Arc<AtomicBool>,
}

impl Interrupt {
    /// From now on the first SIGINT or SIGTERM is noted here, and the second ends the program at once; so are SIGHUP and
    /// SIGUSR1, which end nothing.
    ///
    /// # Errors
    /// The system refuses; then signals end the program as they always do.
    pub fn listen(&self) -> std::io::Result<()> {
        for signal in [SIGINT, SIGTERM] {
            // In this order: a first signal must find the flag still unset when it asks whether to end the program.
            flag::register_conditional_shutdown(signal, INTERRUPTED.into(), Arc::clone(&self.stop))?;
            flag::register(signal, Arc::clone(&self.stop))?;
        }
        for signal in [SIGHUP, SIGUSR1] {
            flag::register(signal, Arc::clone(&self.snapshot))?;
        }
        Ok(())
    }

    /// Whether a snapshot was asked for since the last time this was asked.
    pub fn snapshot_requested(&self) -> bool {
        self.snapshot.swap(false, Ordering::Relaxed)
    }

    /// Whether a signal to stop has come.
    pub fn requested(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
