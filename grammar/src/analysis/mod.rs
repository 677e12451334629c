//! What can be said of rules without a graph: which can never match, which variables do nothing,
//! which rules nothing can wake, and which can disable each other.
//!
//! Guarantee: a rule that is said never to match does not; a conflict that is shown happens in the
//! graph that it is shown with.

mod adrift;
mod complete;
mod conflict;
mod contradiction;
mod draft;
mod facts;
mod kinds;
mod manifest;
mod never;
mod order;
mod reach;
mod side;
mod unused;
mod values;

pub use conflict::{CONFLICT_LIMIT, Conflict, Conflicts, EFFORT_LIMIT, OVERLAY_LIMIT, Undecided};

use crate::parser::Finding;
use crate::{Diagnostic, Grammar, Name, Problem, SourceFile};
use dsr::{Manifest, ReadError, Schema, Snapshot};
use std::collections::BTreeSet;

/// A finding at a name.
fn at(name: &Name, problem: Problem) -> Finding {
    Finding {
        span: name.span(),
        problem,
        related: None,
    }
}

impl Grammar {
    /// Rules that can never match, by themselves or under a schema; variables that nothing uses;
    /// dormant rules that nothing activates.
    ///
    /// # Example
    /// ```
    /// let text = "name=x\n===\nodd : active(1) { { a:room b:room } => { a:room b:room }\n\
    ///             precondition { (and (> a.area 5) (< a.area 3)) } }\n";
    /// let (grammar, _) = grammar::parse_grammar(text, "x.aggl");
    /// let found = grammar.analyse(None);
    /// assert_eq!(found[0].to_string(), "this rule never matches: no `a.area` is (> 5) and (< 3)");
    /// assert_eq!(found[1].to_string(), "nothing uses `b`: it only asks for one more `room`");
    /// ```
    pub fn analyse(&self, schema: Option<&Schema>) -> Vec<Diagnostic> {
        let mut findings = Vec::new();
        let woken = self.rules.iter().flat_map(|rule| &rule.activates);
        let woken: BTreeSet<&Name> = woken.collect();
        for rule in &self.rules {
            if let Some(reason) = never::why_never(self, rule, schema) {
                findings.push(at(&rule.name, Problem::NeverMatches { reason }));
            } else {
                never::amounts(self, rule, schema, &mut findings);
            }
            unused::variables(rule, &mut findings);
            adrift::links(rule, &mut findings);
            if rule.dormant && !woken.contains(&rule.name) {
                let reason = "it is dormant, and no rule activates it".to_owned();
                findings.push(at(&rule.name, Problem::Unreachable { reason }));
            }
        }
        findings.sort_by_key(|finding| finding.span);
        crate::load::diagnostics(findings, &self.files)
    }

    /// What an agent's rules do that its manifest gives no right to but by the rule; rules of the
    /// agent that the manifest does not give; and rules that it gives and the grammar does not have.
    /// `file` is the manifest's, which the last point into.
    ///
    /// # Example
    /// ```
    /// let text = "name=x\n===\ntidy : active(1) agent(keeper) { { c:cup } => { } }\n";
    /// let (grammar, _) = grammar::parse_grammar(text, "x.aggl");
    /// let text = "agent = \"keeper\"\nrules = [\"tidy\", \"tydi\"]\n";
    /// let manifest = dsr::Manifest::from_toml("keeper.toml", text, &dsr::Schema::open())?;
    /// let file = grammar::SourceFile::new("keeper.toml", text);
    /// let found = grammar.check_manifest(None, &manifest, &file);
    /// let told: Vec<String> = found.iter().map(ToString::to_string).collect();
    /// assert_eq!(told, [
    ///     "this deletes a `cup`, which the manifest of `keeper` gives only by this rule",
    ///     "no rule `tydi`",
    /// ]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check_manifest(
        &self,
        schema: Option<&Schema>,
        manifest: &Manifest,
        file: &SourceFile,
    ) -> Vec<Diagnostic> {
        manifest::check(self, schema, manifest, file)
    }

    /// Rules that no rule can make applicable from what a graph has: even if nothing that once
    /// held ever ceased to, something on their left side would be missing.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read any more.
    pub fn unreachable(&self, snapshot: &Snapshot) -> Result<Vec<Diagnostic>, ReadError> {
        let findings = reach::unreachable(self, snapshot)?;
        Ok(crate::load::diagnostics(findings, &self.files))
    }

    /// Which rules can disable which: both match in the graph shown, and after the first was
    /// applied the second does not match there any more. A rule can disable another match of
    /// itself.
    ///
    /// The graph is one of the smallest overlays of the two left sides, completed by what must hold for the second not to
    /// match after the first; values are such as the schema allows. A pair that is neither given nor told as undecided was
    /// shown to be no conflict, as far as types inherit from each other by the grammar.
    ///
    /// At most [`OVERLAY_LIMIT`] ways to lay one over the other are looked at. No more than [`CONFLICT_LIMIT`] are given. All
    /// together may take no more than `effort`, of which each pair of rules has an equal share at first (at least 5,000,000 as long as there is any); what some
    /// leave is for the others. With [`EFFORT_LIMIT`] that is at most some ten seconds.
    pub fn conflicts(&self, schema: Option<&Schema>, effort: u64) -> Conflicts {
        conflict::conflicts(self, schema, effort)
    }
}

#[cfg(test)]
mod tests;
