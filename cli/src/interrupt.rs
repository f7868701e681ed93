//! Requests from outside to stop: Ctrl-C, and the signal by which farms and batch systems announce that time is up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::exit::INTERRUPTED;

/// Whether the program has been asked to stop.
#[derive(Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on the first SIGINT or SIGTERM is noted here, and the second ends the program at once.
    ///
    /// # Errors
    /// The system refuses; then signals end the program as they always do.
    pub fn listen(&self) -> std::io::Result<()> {
        for signal in [SIGINT, SIGTERM] {
            // In this order: a first signal must find the flag still unset when it asks whether to end the program.
            flag::register_conditional_shutdown(signal, INTERRUPTED.into(), Arc::clone(&self.0))?;
            flag::register(signal, Arc::clone(&self.0))?;
        }
        Ok(())
    }

    /// Whether a signal has come.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
