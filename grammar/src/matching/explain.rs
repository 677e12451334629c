//! Search plans for people.
//!
//! Guarantee: what is shown is the plan that a search for the same rule in the same snapshot goes
//! by.

use super::environment::{Interrupt, WHOLE_LIMIT};
use super::plan::{Plan, Source, plan};
use super::query::{Problem, Query};
use super::search::Search;
use super::statistics::Statistics;
use super::{MatchError, conjuncts};
use crate::{Binding, Condition, Effect, Grammar, Pattern, Rule};
use dsr::{Schema, Snapshot, ValueRange};
use std::borrow::Cow;
use std::sync::Arc;

/// How the matches of a rule are searched for.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchPlan {
    /// The rule.
    pub rule: String,
    /// Links and conditions on the nodes that are given, looked at first.
    pub checks: Vec<String>,
    /// In order.
    pub steps: Vec<SearchStep>,
    /// Candidates and checks expected in a whole search.
    pub cost: f64,
    /// Whether the counts are the graph's own, not what is taken for granted where there is none:
    /// a hundred nodes of a type, two links of a label at each.
    pub counted: bool,
    /// How many nodes had been tried, for one match ([`SEARCH_LIMIT`](crate::SEARCH_LIMIT)) or for all of them
    /// ([`WHOLE_LIMIT`]), when the search was given up: what its steps found is what they found until then.
    pub given_up: Option<u64>,
}

/// One step of a search: candidates for one variable, or for both ends of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchStep {
    /// Variables that it binds.
    pub binds: Vec<String>,
    /// Where candidates come from.
    pub source: String,
    /// Links and conditions looked at for each.
    pub checks: Vec<String>,
    /// Candidates expected in a whole search.
    pub candidates: f64,
    /// How many of them are expected to pass.
    pub passing: f64,
    /// Candidates that a whole search had, and how many of them passed.
    pub found: Option<[u64; 2]>,
}

impl Grammar {
    /// The plan by which [`Self::matches`] searches a snapshot, with what a whole search comes
    /// across; without a snapshot, the plan for a graph of which nothing is known.
    ///
    /// # Errors
    /// [`MatchError`], as for [`Self::matches`].
    pub fn search_plan(
        &self,
        snapshot: Option<&Snapshot>,
        rule: &Rule,
        partial: &Binding,
    ) -> Result<SearchPlan, MatchError> {
        self.search_plan_within(snapshot, rule, partial, WHOLE_LIMIT)
    }

    /// The same, where the whole search tries no more nodes than `limit`.
    ///
    /// # Errors
    /// [`MatchError`], as for [`Self::matches`].
    pub fn search_plan_within(
        &self,
        snapshot: Option<&Snapshot>,
        rule: &Rule,
        partial: &Binding,
        limit: u64,
    ) -> Result<SearchPlan, MatchError> {
        let schema = self.schema_in(snapshot);
        let schema = schema.as_ref();
        let problem = Arc::new(self.rule_query(schema, rule)?).at(&rule.name, partial)?;
        let query = Arc::clone(&problem.query);
        let statistics = Statistics::known(snapshot, &query)?;
        let plan = Arc::new(plan(&query, &statistics, &problem.given()));
        let seen = snapshot.map(|snapshot| run(snapshot, problem, &plan, limit));
        let (seen, given_up) = seen.transpose()?.unzip();
        let words = Words {
            rule,
            query: &query,
            schema,
        };
        let steps = plan.steps.iter().enumerate().map(|(index, step)| {
            let binds = step.binds.iter().flatten();
            SearchStep {
                binds: binds
                    .map(|&slot| query.variables[slot].to_string())
                    .collect(),
                source: words.source(step.source),
                checks: words.checks(step.links.iter().map(|(link, _)| *link), &step.tests),
                candidates: step.candidates,
                passing: step.passing,
                found: seen.as_ref().map(|seen| seen[index]),
            }
        });
        Ok(SearchPlan {
            rule: rule.name.to_string(),
            checks: words.checks(plan.links.iter().copied(), &plan.tests),
            steps: steps.collect(),
            cost: plan.cost,
            counted: snapshot.is_some(),
            given_up: given_up.flatten(),
        })
    }

    /// The schema of a snapshot; without one, a schema of this grammar's names.
    pub(super) fn schema_in<'a>(&self, snapshot: Option<&'a Snapshot>) -> Cow<'a, Schema> {
        match snapshot {
            Some(snapshot) => Cow::Borrowed(snapshot.schema()),
            None => Cow::Owned(self.schema_of_names()),
        }
    }

    /// A schema that has every name of the grammar, so that nothing is known to be missing.
    fn schema_of_names(&self) -> Schema {
        let mut schema = Schema::open();
        let mut add = |node: Option<&str>, label: Option<&str>| {
            // A name that no schema can have is in no graph.
            let _ = node.map(|name| schema.add_type(name, &[]));
            let _ = label.map(|name| schema.add_label(name, &[], &[]));
        };
        for name in self.types.names().chain(self.types.undeclared()) {
            add(Some(name), None);
        }
        for rule in &self.rules {
            for side in [&rule.left, &rule.right] {
                pattern_names(side, &mut add);
            }
            for parameter in &rule.parameters {
                add(Some(&parameter.type_name), None);
            }
            if let Some(condition) = &rule.precondition {
                condition_names(condition, &mut add);
            }
            for effect in &rule.effect {
                if let Effect::When { condition, .. } = effect {
                    condition_names(condition, &mut add);
                }
            }
        }
        schema
    }
}

type Add<'a> = dyn FnMut(Option<&str>, Option<&str>) + 'a;

fn pattern_names(pattern: &Pattern, add: &mut Add<'_>) {
    for node in &pattern.nodes {
        add(Some(&node.type_name), None);
    }
    for edge in &pattern.edges {
        add(None, Some(&edge.label));
    }
}

fn condition_names(condition: &Condition, add: &mut Add<'_>) {
    match condition {
        Condition::Edge { label, .. } => add(None, Some(label)),
        Condition::Same(..) | Condition::Compare { .. } => {}
        Condition::Not(inner) => condition_names(inner, add),
        Condition::And(all) | Condition::Or(all) => {
            for inner in all {
                condition_names(inner, add);
            }
        }
        Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
            for variable in variables {
                add(Some(&variable.type_name), None);
            }
            condition_names(body, add);
        }
        Condition::When {
            condition,
            consequence,
        } => {
            condition_names(condition, add);
            condition_names(consequence, add);
        }
    }
}

/// A whole search, or as far as it gets: by step, how many candidates there were and how many passed;
/// and the limit that ended it.
type Seen = (Vec<[u64; 2]>, Option<u64>);

fn run(
    snapshot: &Snapshot,
    mut problem: Problem,
    plan: &Arc<Plan>,
    limit: u64,
) -> Result<Seen, MatchError> {
    problem.environment.set_whole_limit(limit);
    let mut search = Search::new(snapshot, problem, Arc::clone(plan));
    let given_up = loop {
        match search.advance() {
            Ok(true) => {}
            Ok(false) => break None,
            Err(Interrupt::Limit(limit) | Interrupt::Whole(limit)) => break Some(limit),
            Err(error) => return Err(error.into()),
        }
    };
    Ok((search.seen().collect(), given_up))
}

pub(super) struct Words<'a> {
    pub(super) rule: &'a Rule,
    pub(super) query: &'a Query,
    pub(super) schema: &'a Schema,
}

impl Words<'_> {
    pub(super) fn source(&self, source: Source) -> String {
        let nodes: Vec<_> = self.rule.bound_nodes().collect();
        let edges = &self.rule.left.edges;
        match source {
            Source::Nodes { slot } => format!("every {}", nodes[slot].type_name),
            Source::Edges { link } => format!("every link `{}`", edges[link].label),
            Source::Out { link } => format!("{} of {}", edges[link].label, edges[link].from),
            Source::In { link } => format!("{} to {}", edges[link].label, edges[link].to),
            Source::Values { bound } => {
                let bound = &self.query.bounds[bound];
                let attribute = self.schema.attribute_name(bound.attribute);
                let range = match &bound.range {
                    ValueRange::Equal(value) => format!("= {}", super::words(value)),
                    ValueRange::Between(from, to) => format!("from {from} to {to}"),
                };
                format!("index of {attribute} {range}")
            }
        }
    }

    pub(super) fn checks(
        &self,
        links: impl Iterator<Item = usize>,
        tests: &[usize],
    ) -> Vec<String> {
        let condition = self.rule.precondition.as_ref();
        let conditions: Vec<&Condition> = condition.into_iter().flat_map(conjuncts).collect();
        let links = links.map(|link| self.rule.left.edges[link].to_string());
        let tests = tests.iter().map(|&test| conditions[test].to_string());
        links.chain(tests).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_grammar;
    use dsr::{Graph, Time, Transaction};

    #[test]
    fn a_search_that_is_given_up_tells_how_far_it_came() {
        let mut graph = Graph::in_memory(Schema::open());
        let mut world = Transaction::new();
        for index in 0..100 {
            world.create_node("box", &format!("b{index}"), vec![]);
        }
        graph.commit(&world, "world", Time::default()).unwrap();
        let snapshot = graph.snapshot();
        let text =
            "name=g\n===\nr : passive(1) { { a:box b:box } => { } precondition { (= a b) } }";
        let (grammar, _) = parse_grammar(text, "g.aggl");
        let query = grammar.rule_query(snapshot.schema(), &grammar.rules[0]);
        let mut problem = Arc::new(query.unwrap()).at("r", &Binding::new()).unwrap();
        let query = Arc::clone(&problem.query);
        let order = plan(&query, &Statistics::assumed(&query), &[]);
        problem.environment.set_limit(1000);
        let (seen, given_up) = run(&snapshot, problem, &Arc::new(order), WHOLE_LIMIT).unwrap();
        assert_eq!(given_up, Some(1000));
        let tried: u64 = seen.iter().map(|[candidates, _]| candidates).sum();
        assert!((900..=1000).contains(&tried), "{seen:?}");
    }
}
