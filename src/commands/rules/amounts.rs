//! What a rule costs and how long it takes at a match.
//!
//! Guarantee: an amount that is not given is given a reason.

use crate::Failure;
use dsr::Snapshot;
use grammar::{Binding, Grammar, MatchError, Rule, ValueError};
use serde_json::{Value as Json, json};

/// An amount, or why there is none.
type Amount = Result<f64, String>;

pub(super) struct Amounts {
    cost: Amount,
    /// `None` where the rule says none.
    duration: Option<Amount>,
}

/// Of a match in a graph.
pub(super) fn amounts(
    grammar: &Grammar,
    snapshot: &Snapshot,
    rule: &Rule,
    binding: &Binding,
) -> Result<Amounts, Failure> {
    let amount = |found: Result<f64, ValueError>| match found {
        Ok(amount) => Ok(Ok(amount)),
        Err(ValueError::Match(MatchError::Read(error))) => Err(Failure::internal(error)),
        Err(why) => Ok(Err(why.to_string())),
    };
    let duration = grammar.duration(snapshot, rule, binding).transpose();
    Ok(Amounts {
        cost: amount(grammar.cost(snapshot, rule, binding))?,
        duration: duration.map(amount).transpose()?,
    })
}

impl Amounts {
    fn each(&self) -> impl Iterator<Item = (&'static str, &'static str, &Amount)> {
        let duration = self
            .duration
            .iter()
            .map(|amount| ("duration", " s", amount));
        std::iter::once(("cost", "", &self.cost)).chain(duration)
    }

    /// A line for people.
    pub(super) fn words(&self) -> String {
        let words = self.each().map(|(what, unit, amount)| match amount {
            Ok(amount) => format!("{what} {amount}{unit}"),
            Err(why) => format!("no {what}: {why}"),
        });
        words.collect::<Vec<_>>().join("; ")
    }

    /// Why there is none, for each that there is not.
    pub(super) fn missing(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let each = self.each();
        each.filter_map(|(what, _, amount)| Some((what, amount.as_ref().err()?.as_str())))
    }

    /// Puts `cost` and `duration` into an answer, `null` where there is none, and why into `amounts_missing`.
    pub(super) fn put(&self, object: &mut Json) {
        object["cost"] = json!(self.cost.as_ref().ok());
        object["duration"] = json!(
            self.duration
                .as_ref()
                .and_then(|amount| amount.as_ref().ok())
        );
        object["amounts_missing"] = self.missing_json();
    }

    pub(super) fn missing_json(&self) -> Json {
        self.missing()
            .map(|(what, why)| (what.to_owned(), json!(why)))
            .collect()
    }
}
