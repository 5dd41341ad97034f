//! What a run tells on the way.

use std::ops::ControlFlow;

use adaptive::Iteration;

/// Something that happens during a run.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// A step begins; its name in a few words.
    Step(&'static str),
    /// An iteration of the adaptive loop is done.
    Iteration(&'a Iteration),
}

/// Told of each [`Event`]. `Break` at an iteration ends the fit with the present result; at a step it changes nothing.
pub type Watch<'a> = dyn FnMut(Event<'_>) -> ControlFlow<()> + 'a;
