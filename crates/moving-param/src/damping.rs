//! How strongly steps are damped.

/// The rule of a damping: its first value, its bounds, and what it does after a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DampingRule {
    pub(crate) first: f64,
    /// Below this the equations are too near to singular.
    pub(crate) least: f64,
    /// Beyond this steps are too short to help.
    pub(crate) most: f64,
    /// Factor after a step that was taken.
    pub(crate) accept: f64,
    /// Factor after one that was refused.
    pub(crate) refuse: f64,
    /// Steps taken after a refused one for which the damping stays as it is.
    pub(crate) pause: usize,
}

/// A damping that follows the success of steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damping {
    rule: DampingRule,
    value: f64,
    /// Steps to be taken before it may fall.
    waits: usize,
}

impl Damping {
    pub(crate) fn new(rule: DampingRule) -> Self {
        Self { rule, value: rule.first, waits: 0 }
    }

    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Takes note of a step that was taken.
    pub(crate) fn accepted(&mut self) {
        if self.waits == 0 {
            self.value = (self.value * self.rule.accept).max(self.rule.least);
        }
        self.waits = self.waits.saturating_sub(1);
    }

    /// Takes note of a step that was refused. False if damping more is in vain; the damping is then the first one again.
    pub(crate) fn refused(&mut self) -> bool {
        self.value = (self.value * self.rule.refuse).max(self.rule.least);
        self.waits = self.rule.pause;
        let goes_on = self.value <= self.rule.most;
        if !goes_on {
            self.value = self.rule.first;
        }
        goes_on
    }

    /// Forgets refused steps.
    pub(crate) fn rest(&mut self) {
        self.waits = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: DampingRule = DampingRule { first: 1.0, least: 0.25, most: 16.0, accept: 0.5, refuse: 4.0, pause: 1 };

    #[test]
    fn damping_falls_to_the_least_and_waits_after_a_refusal() {
        let mut damping = Damping::new(RULE);
        for expected in [0.5, 0.25, 0.25] {
            damping.accepted();
            assert_eq!(damping.value(), expected);
        }
        assert!(damping.refused());
        let refused = damping.value();
        damping.accepted();
        assert_eq!(damping.value(), refused);
        damping.accepted();
        assert!(damping.value() < refused);
        assert!(damping.refused());
        let refused = damping.value();
        damping.rest();
        damping.accepted();
        assert!(damping.value() < refused);
    }

    #[test]
    fn damping_beyond_the_most_gives_up_and_begins_anew() {
        let mut damping = Damping::new(RULE);
        assert_eq!([damping.refused(), damping.refused(), damping.refused()], [true, true, false]);
        assert_eq!(damping.value(), 1.0);
    }
}
