//! The grammar in the graph: how rules change while a system runs, and which of them are awake.
//!
//! Guarantee: a graph never has rules that its store does not go by: a commit that changes them is
//! refused whole unless they read without an error and fit the schema, and from it on they hold.
//!
//! The node [`NODE`] of type [`NODE`] has two attributes: [`RULES`], the whole text of the grammar
//! with what it includes, and [`AWAKE`], the names of the dormant rules that are awake, each
//! followed by a blank. Applying a rule that `activates` others adds them there.

use crate::{Defects, Diagnostic, Grammar, Rule, Severity, parse_grammar};
use dsr::{Change, Operation, Owner, ReadError, Refusal, Schema, Snapshot, Transaction, Version};
use std::collections::BTreeSet;
use std::fmt::{self, Display, Formatter};

/// Name and type of the node that has the grammar.
pub const NODE: &str = "grammar";
/// Its attribute that has the text.
pub const RULES: &str = "rules";
/// Its attribute that has the names of dormant rules that are awake.
pub const AWAKE: &str = "awake";

/// A grammar as a graph has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Published {
    /// The whole text.
    pub text: String,
    /// The version of the graph that brought it.
    pub version: Version,
}

impl Published {
    /// The grammar that a graph has, if it has one.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read any more.
    pub fn find(snapshot: &Snapshot) -> Result<Option<Self>, ReadError> {
        let Some(node) = snapshot.find_node_by_name(NODE)?.filter(is_grammar) else {
            return Ok(None);
        };
        let Some(name) = snapshot.schema().find_attribute(RULES) else {
            return Ok(None);
        };
        let found = node.attribute(name)?;
        Ok(found.and_then(|attribute| match attribute.value {
            dsr::Value::String(text) => Some(Self {
                text,
                version: attribute.version,
            }),
            _ => None,
        }))
    }

    /// The version of the graph that brought its grammar; `None` where it has none. Cheap: the text
    /// is not read.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read any more.
    pub fn version(snapshot: &Snapshot) -> Result<Option<Version>, ReadError> {
        let Some(node) = snapshot.find_node_by_name(NODE)?.filter(is_grammar) else {
            return Ok(None);
        };
        let Some(name) = snapshot.schema().find_attribute(RULES) else {
            return Ok(None);
        };
        Ok(node.attribute(name)?.map(|attribute| attribute.version))
    }

    /// The grammar, if nothing is wrong with it under the schema.
    ///
    /// # Errors
    /// [`Defects`] with everything that is wrong.
    pub fn read(&self, schema: &Schema) -> Result<Grammar, Defects> {
        let (grammar, mut diagnostics) = parse_grammar(&self.text, NODE);
        diagnostics.extend(grammar.check_schema(schema));
        let error = |diagnostic: &Diagnostic| diagnostic.severity() == Severity::Error;
        diagnostics.retain(error);
        if diagnostics.is_empty() {
            Ok(grammar)
        } else {
            Err(Defects { diagnostics })
        }
    }
}

/// A grammar as one text: types, rules and combos of all its files.
struct Whole<'a>(&'a Grammar);

impl Display for Whole<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let grammar = self.0;
        for property in &grammar.properties {
            writeln!(f, "{}={}", property.key, property.value)?;
        }
        writeln!(f, "===")?;
        if !grammar.types.is_empty() {
            writeln!(f, "types\n{{")?;
            let mut seen = BTreeSet::new();
            // Several files may declare one type: together they say all that it inherits from.
            for name in grammar.types.names() {
                if !seen.insert(name.as_str()) {
                    continue;
                }
                let mut parents: Vec<&str> = Vec::new();
                for parent in grammar.types.parents(name) {
                    if !parents.contains(&parent.as_str()) {
                        parents.push(parent);
                    }
                }
                if parents.is_empty() {
                    writeln!(f, "({name})")?;
                } else {
                    writeln!(f, "({name} : {})", parents.join(" "))?;
                }
            }
            writeln!(f, "}}\n===")?;
        }
        for rule in &grammar.rules {
            write!(f, "\n{rule}")?;
        }
        for combo in &grammar.combos {
            write!(f, "\n{combo}")?;
        }
        Ok(())
    }
}

impl Grammar {
    /// The grammar as one text that stands alone: what it includes is part of it.
    pub fn whole_text(&self) -> String {
        Whole(self).to_string()
    }

    /// Puts the grammar into a graph: the transaction, once committed, makes it the one in force.
    /// Dormant rules that are awake stay awake if they are dormant in this grammar, too.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read any more.
    pub fn publish(&self, snapshot: &Snapshot) -> Result<Transaction, ReadError> {
        let mut transaction = Transaction::new();
        if snapshot.find_node_by_name(NODE)?.is_none() {
            let attributes = [(RULES, self.whole_text()), (AWAKE, String::new())]
                .map(|(name, text)| (name.to_owned(), text.into()));
            transaction.create_node(NODE, NODE, attributes.to_vec());
            return Ok(transaction);
        }
        let awake = self.awake(snapshot)?;
        transaction.set(NODE, RULES, self.whole_text());
        transaction.set(NODE, AWAKE, listed(&awake));
        Ok(transaction)
    }

    /// The dormant rules that are awake in a graph.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read any more.
    pub fn awake(&self, snapshot: &Snapshot) -> Result<BTreeSet<String>, ReadError> {
        let Some(node) = snapshot.find_node_by_name(NODE)?.filter(is_grammar) else {
            return Ok(BTreeSet::new());
        };
        let Some(name) = snapshot.schema().find_attribute(AWAKE) else {
            return Ok(BTreeSet::new());
        };
        let text = match node.attribute(name)?.map(|attribute| attribute.value) {
            Some(dsr::Value::String(text)) => text,
            _ => String::new(),
        };
        let dormant = |name: &&str| self.own_rule(name).is_some_and(|rule| rule.dormant);
        Ok(text
            .split_whitespace()
            .filter(dormant)
            .map(str::to_owned)
            .collect())
    }

    /// A dormant rule that has to be awake for `rule` to be applied, and is not.
    pub(crate) fn asleep(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
    ) -> Result<Option<String>, ReadError> {
        let mut steps: Vec<&Rule> = vec![rule];
        if self.own_rule(&rule.name).is_none()
            && let Some(unfolded) = self.unfolding(&rule.name)
        {
            let own = |step: &crate::UnfoldedStep| self.own_rule(&step.rule);
            steps = unfolded.steps.iter().filter_map(own).collect();
        }
        if steps.iter().all(|step| !step.dormant) {
            return Ok(None);
        }
        let mut awake = self.awake(snapshot)?;
        for step in steps {
            if step.dormant && !awake.contains(&*step.name) {
                return Ok(Some(step.name.to_string()));
            }
            awake.extend(step.activates.iter().map(ToString::to_string));
        }
        Ok(None)
    }

    /// What wakes the rules that `rule` activates; nothing where they are awake.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read any more.
    pub fn waking(&self, snapshot: &Snapshot, rule: &Rule) -> Result<Vec<Operation>, ReadError> {
        let dormant = |name: &&crate::Name| self.own_rule(name).is_some_and(|r| r.dormant);
        let mut woken = rule.activates.iter().filter(dormant).peekable();
        if woken.peek().is_none() {
            return Ok(Vec::new());
        }
        let before = self.awake(snapshot)?;
        let mut after = before.clone();
        after.extend(woken.map(ToString::to_string));
        if after == before {
            return Ok(Vec::new());
        }
        let value = listed(&after).into();
        Ok(vec![if snapshot.find_node_by_name(NODE)?.is_some() {
            Operation::SetAttribute {
                owner: Owner::Node(NODE.into()),
                name: AWAKE.to_owned(),
                value,
            }
        } else {
            Operation::CreateNode {
                id: None,
                type_name: NODE.to_owned(),
                name: NODE.to_owned(),
                attributes: vec![(AWAKE.to_owned(), value)],
            }
        }])
    }

    /// The grammar to go by after a change: `None` where the change leaves the rules alone.
    ///
    /// # Errors
    /// [`Refusal`] where the rules that it brings have something wrong with them.
    pub(crate) fn successor(after: &Snapshot, change: &Change) -> Result<Option<Self>, Refusal> {
        let schema = after.schema();
        let Some(type_id) = schema.find_type(NODE) else {
            return Ok(None);
        };
        let rules = schema.find_attribute(RULES);
        let touches = |node: &&dsr::NodeChange| {
            node.type_id == type_id && rules.is_some_and(|rules| node.attributes.contains(&rules))
        };
        if !change.nodes.iter().any(|node| touches(&node)) {
            return Ok(None);
        }
        let unreadable = |error: ReadError| Refusal::Malformed(error.to_string());
        let Some(published) = Published::find(after).map_err(unreadable)? else {
            return Ok(None);
        };
        published.read(schema).map(Some).map_err(|defects| {
            Refusal::SchemaViolation(format!("the rules are refused:\n{defects}"))
        })
    }
}

fn is_grammar(node: &dsr::Node<'_>) -> bool {
    node.type_name() == NODE
}

/// Names, each followed by a blank.
fn listed(names: &BTreeSet<String>) -> String {
    let mut text = String::new();
    for name in names {
        text.push_str(name);
        text.push(' ');
    }
    text
}

#[cfg(test)]
mod tests;
