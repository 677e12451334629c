//! What a grammar file holds: header, types, rules, combos, includes; and goals.
//!
//! Guarantee: `rules` has the rules of every file that was read, in reading order, also where
//! other rules were broken.

use crate::{Condition, Name, Pattern, Region, Rule, SourceFile, Unfolded};
use dsr::{NodeType, Schema};
use std::collections::BTreeMap;

/// The rules of a file and of the files it includes.
#[derive(Debug, Clone, Default)]
pub struct Grammar {
    /// `key = value` lines before the first `===` of the main file.
    pub properties: Vec<Property>,
    /// Types of all files.
    pub types: Types,
    /// Rules of all files: those of an included file stand where the `include` stands.
    pub rules: Vec<Rule>,
    /// Combo rules of all files, in the same order.
    pub combos: Vec<Combo>,
    /// The ordinary rules that the combos stand for; made from `rules` and `combos` by reading.
    pub unfolded: Vec<Unfolded>,
    /// `include(path)` of all files.
    pub includes: Vec<Include>,
    /// Comment lines of the main file that no rule, combo or include follows.
    pub comments: Vec<String>,
    /// The files read; 0 is the main one. Spans index into it.
    pub files: Vec<SourceFile>,
    /// The parts of the files; see [`Grammar::sound`].
    pub regions: Vec<Region>,
}

impl Grammar {
    /// The rule with this name; that of a combo is the one it unfolds into.
    pub fn rule(&self, name: &str) -> Option<&Rule> {
        let unfolded = || self.unfolding(name).map(|unfolded| &unfolded.rule);
        self.own_rule(name).or_else(unfolded)
    }

    /// The rule with this name that a combo unfolds into.
    pub fn unfolding(&self, name: &str) -> Option<&Unfolded> {
        self.unfolded
            .iter()
            .find(|unfolded| unfolded.rule.name == *name)
    }

    /// The rule that is written under this name.
    pub(crate) fn own_rule(&self, name: &str) -> Option<&Rule> {
        self.rules.iter().find(|rule| rule.name == *name)
    }

    /// Every rule that can be matched and applied: those written, then those unfolded.
    pub fn all_rules(&self) -> impl Iterator<Item = &Rule> {
        let unfolded = self.unfolded.iter().map(|unfolded| &unfolded.rule);
        self.rules.iter().chain(unfolded)
    }

    /// Value of the header property `key`; the last one wins.
    pub fn property(&self, key: &str) -> Option<&str> {
        let property = self
            .properties
            .iter()
            .rev()
            .find(|property| property.key == *key)?;
        Some(&property.value)
    }
}

/// Two grammars are equal if they say the same; the text they were read from is no part of it.
impl PartialEq for Grammar {
    fn eq(&self, other: &Self) -> bool {
        self.properties == other.properties
            && self.types == other.types
            && self.rules == other.rules
            && self.combos == other.combos
            && self.includes == other.includes
            && self.comments == other.comments
    }
}

/// One line of the header: an editor's setting, or the grammar's `name`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    /// Before the `=`.
    pub key: Name,
    /// After it, without surrounding blanks.
    pub value: String,
}

/// `include(path)`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Include {
    /// As written.
    pub path: Name,
    /// Comment lines before it, without `#`.
    pub comments: Vec<String>,
}

/// The types block: names and what they inherit from.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Types {
    /// `( sub ... : parent ... )` as written, of all files.
    pub declarations: Vec<TypeDeclaration>,
}

/// `( names : parents )`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TypeDeclaration {
    /// The types declared.
    pub names: Vec<Name>,
    /// What each of them inherits from; may be empty.
    pub parents: Vec<Name>,
}

impl Types {
    /// The node types of a graph, for goals that are read without a grammar.
    pub fn of_schema(schema: &Schema) -> Self {
        let declaration = |node_type: &NodeType| TypeDeclaration {
            names: vec![node_type.name.as_str().into()],
            parents: node_type
                .parents
                .iter()
                .map(|&parent| schema.type_name(parent).into())
                .collect(),
        };
        Self {
            declarations: schema.types().iter().map(declaration).collect(),
        }
    }

    /// Whether no type is declared, as in files from before 2017: then any type name is allowed.
    pub fn is_empty(&self) -> bool {
        self.declarations.is_empty()
    }

    /// Every declared type, in the order written.
    pub fn names(&self) -> impl Iterator<Item = &Name> {
        self.declarations
            .iter()
            .flat_map(|declaration| &declaration.names)
    }

    /// Types that stand only where others inherit from them, each once: roots, as in many files
    /// from elsewhere.
    pub fn undeclared(&self) -> impl Iterator<Item = &Name> {
        let mut roots: Vec<&Name> = Vec::new();
        for parent in self.declarations.iter().flat_map(|d| &d.parents) {
            if !roots.contains(&parent) && !self.names().any(|declared| declared == parent) {
                roots.push(parent);
            }
        }
        roots.into_iter()
    }

    /// Whether `name` is declared, or a declared type inherits from it.
    pub fn contains(&self, name: &str) -> bool {
        let parents = self.declarations.iter().flat_map(|d| &d.parents);
        self.names().chain(parents).any(|known| known == name)
    }

    /// What `name` inherits from directly.
    pub fn parents<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Name> + 'a {
        self.declarations
            .iter()
            .filter(move |declaration| declaration.names.iter().any(|sub| sub == name))
            .flat_map(|declaration| &declaration.parents)
    }

    /// Whether `sub` is `ancestor` or inherits from it, by the types block alone.
    pub fn is_subtype(&self, sub: &str, ancestor: &str) -> bool {
        let mut reached = vec![sub];
        let mut next = 0;
        while let Some(&name) = reached.get(next) {
            if name == ancestor {
                return true;
            }
            for parent in self.parents(name) {
                if !reached.contains(&parent.as_str()) {
                    reached.push(parent);
                }
            }
            next += 1;
        }
        false
    }
}

/// A rule made of others, carried out one after another with shared nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Combo {
    /// Unique among rules and combos.
    pub name: Name,
    /// What it costs, without unit.
    pub cost: f64,
    /// `active` or `passive`.
    pub kind: crate::Kind,
    /// In the order they are carried out.
    pub steps: Vec<ComboStep>,
    /// `a.x = b.y = ...`: each list names one node.
    pub equalities: Vec<Vec<ComboVariable>>,
    /// Comment lines before and inside it, without `#`.
    pub comments: Vec<String>,
}

/// `rule as alias [optional]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ComboStep {
    /// The rule.
    pub rule: Name,
    /// What this use of it is called.
    pub alias: Name,
    /// May be left out.
    pub optional: bool,
}

/// `alias.variable`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ComboVariable {
    /// A step's alias.
    pub alias: Name,
    /// A variable of that step's rule.
    pub variable: Name,
}

/// What a mission wants to hold: a graph to be found, and a condition.
///
/// A node of `pattern` is a constant if its variable is a key of `constants`, else a variable
/// that any fitting node may take. Constants and variables together are matched injectively.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Goal {
    /// What must be found.
    pub pattern: Pattern,
    /// Existing nodes, by the text that names them in `pattern` and `precondition` (a quoted
    /// name keeps its quotes there).
    pub constants: BTreeMap<String, Constant>,
    /// What must hold besides.
    pub precondition: Option<Condition>,
}

/// An existing node that a goal names.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Constant {
    /// A digit-leading name: the node with this id.
    Id(u64),
    /// A quoted name: the node with this unique name.
    Name(String),
}
