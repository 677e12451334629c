//! What outcomes teach: a rule whose steps fail costs more than it says. This file guarantees that a
//! rule of which no step failed is planned with as it stands in the grammar.

use super::Config;
use super::failures::{Failures, Silent};
use super::record::{self, Step, StepStatus};
use crate::Raised;
use dsr::{ReadError, Snapshot};
use grammar::{Arithmetic, Expression, Grammar, Literal};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// What a rule says of its success counts as much as so many outcomes.
const WEIGHT: f64 = 10.0;
/// The outcomes of so many missions are read, the newest.
const MISSIONS: usize = 20;

/// The steps of the newest missions.
pub(super) fn recent(snapshot: &Snapshot) -> Result<Vec<Step>, ReadError> {
    let mut steps = Vec::new();
    for mission in record::missions(snapshot)?.iter().rev().take(MISSIONS) {
        steps.extend(record::steps(snapshot, mission.id)?);
    }
    Ok(steps)
}

/// What the executive would plan a new mission with: the grammar as outcomes bear it out, and what costs more
/// since its agent did not take steps lately.
///
/// # Errors
/// [`ReadError`].
pub fn experience(
    grammar: &Grammar,
    snapshot: &Snapshot,
) -> Result<(Grammar, Vec<Raised>), ReadError> {
    let config = Config::default();
    let steps = recent(snapshot)?;
    let failures = Failures::of(&[], &steps, snapshot.time(), &config);
    let raised = failures.raised(grammar, &config, Silent::Asked);
    Ok((learned(grammar, &steps).into_owned(), raised))
}

/// The grammar with the success of each rule as `steps` bear it out, and with costs by which a rule that fails
/// more often than it says has to be tried more often.
pub(super) fn learned<'a>(grammar: &'a Grammar, steps: &[Step]) -> Cow<'a, Grammar> {
    let mut outcomes: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for step in steps {
        let (done, failed) = match step.status {
            StepStatus::Done => (1.0, 0.0),
            StepStatus::Failed => (0.0, 1.0),
            _ => continue,
        };
        let known = outcomes.entry(&step.rule).or_default();
        known.0 += done;
        known.1 += failed;
    }
    outcomes.retain(|_, (_, failed)| *failed > 0.0);
    if outcomes.is_empty() {
        return Cow::Borrowed(grammar);
    }
    let mut grammar = grammar.clone();
    for rule in &mut grammar.rules {
        let Some(&(done, failed)) = outcomes.get(&*rule.name) else {
            continue;
        };
        let success = (WEIGHT * rule.success + done) / (WEIGHT + done + failed);
        let tries = Expression::Literal(Literal::Real(rule.success / success));
        let cost = std::mem::replace(&mut rule.cost, Expression::number(0.0));
        rule.cost = Expression::Arithmetic {
            operator: Arithmetic::Multiply,
            operands: vec![cost, tries],
        };
        rule.success = success;
    }
    Cow::Owned(grammar)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mission::testing::{Agent, GREET_ANA, House};

    #[test]
    fn a_rule_whose_steps_fail_becomes_dearer_and_others_stay_as_they_are() {
        let mut house = House::new(&[("greet", GREET_ANA, 0)]);
        house.run(3);
        let rules = crate::testing::read(crate::mission::testing::RULES);
        let before = learned(&rules, &recent(&house.graph.snapshot()).unwrap());
        assert!(matches!(before, Cow::Borrowed(_)));
        house.agent = Agent::FailsAt("approach");
        house.run(8);
        let after = learned(&rules, &recent(&house.graph.snapshot()).unwrap());
        let steps = house.steps();
        let failed = |line: &&str| line.contains(") failed: ") && !line.contains(") dropped: ");
        let failed = steps.lines().filter(failed).count() as f64;
        assert!(failed > 0.0);
        let [told, approach] = [&rules, &*after].map(|g| g.rule("approach").unwrap());
        let success = 10.0 * told.success / (10.0 + failed);
        assert!((approach.success - success).abs() < 1e-12);
        assert!(approach.cost.to_string().contains('*'), "{}", approach.cost);
        assert_eq!(after.rule("changeRoom"), rules.rule("changeRoom"));
    }
}
