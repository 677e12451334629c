//! Manifest files: TOML that says what one agent may write. This file guarantees that every name
//! in it is one of the schema, and tells all that are not at once, each with its place.

use super::{ANY, AttributeRight, Manifest, RuleRight};
use crate::{Schema, suggest};
use miette::{Diagnostic, NamedSource, SourceSpan};
use serde::Deserialize;
use std::ops::Range;
use thiserror::Error;
use toml::Spanned;

/// All that is wrong with a manifest file.
#[derive(Debug, Clone, Error, Diagnostic)]
#[error("{} in the manifest", match .defects.len() { 1 => "a fault".to_owned(), n => format!("{n} faults") })]
#[diagnostic(code(manifest))]
pub struct ManifestError {
    #[source_code]
    text: NamedSource<String>,
    #[related]
    defects: Vec<Defect>,
}

/// One thing that is wrong.
#[derive(Debug, Clone, Error, Diagnostic)]
#[error("{message}")]
struct Defect {
    message: String,
    #[label("here")]
    span: Option<SourceSpan>,
    #[help]
    help: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    agent: Spanned<String>,
    #[serde(default)]
    nodes: Vec<Spanned<String>>,
    #[serde(default)]
    edges: Vec<Spanned<String>>,
    #[serde(default)]
    attributes: Vec<Spanned<String>>,
    #[serde(default)]
    rules: Vec<Spanned<String>>,
    #[serde(default)]
    several: bool,
}

/// Looks names up and notes those that are not there.
struct Reader<'a> {
    schema: &'a Schema,
    defects: Vec<Defect>,
}

impl Reader<'_> {
    fn types(&self) -> impl Iterator<Item = &str> + Clone {
        self.schema.types().iter().map(|t| t.name.as_str())
    }

    fn labels(&self) -> impl Iterator<Item = &str> + Clone {
        self.schema.labels().iter().map(|l| l.name.as_str())
    }

    fn attributes(&self) -> impl Iterator<Item = &str> + Clone {
        self.schema.attributes().iter().map(|a| a.name.as_str())
    }

    fn note(&mut self, message: String, span: Range<usize>, help: Option<String>) {
        self.defects.push(Defect {
            message,
            span: Some(span.into()),
            help,
        });
    }

    /// Notes `name` where it is none of the known; a schema that is open knows every name.
    fn check(&mut self, what: &str, name: &str, span: Range<usize>, known: &[String]) {
        if name == ANY || self.schema.is_open() || known.iter().any(|k| k == name) {
            return;
        }
        let help = suggest(name, known.iter().map(String::as_str));
        let help = help.map(|known| format!("did you mean `{known}`?"));
        self.note(format!("unknown {what} `{name}`"), span, help);
    }

    fn names(&mut self, what: &str, list: &[Spanned<String>], known: &[String]) -> Vec<String> {
        for name in list {
            self.check(what, name.get_ref(), name.span(), known);
        }
        list.iter().map(|name| name.get_ref().clone()).collect()
    }

    fn attribute(&mut self, text: &Spanned<String>) -> Option<AttributeRight> {
        let Some((owner, attribute)) = text.get_ref().split_once('.') else {
            let help = "write OWNER.ATTRIBUTE, where OWNER is a type, a label or `*`".to_owned();
            let message = format!("`{}` does not say whose attribute it is", text.get_ref());
            self.note(message, text.span(), Some(help));
            return None;
        };
        let owners: Vec<String> = self
            .types()
            .chain(self.labels())
            .map(str::to_owned)
            .collect();
        let attributes: Vec<String> = self.attributes().map(str::to_owned).collect();
        self.check("type or label", owner, text.span(), &owners);
        self.check("attribute", attribute, text.span(), &attributes);
        Some(AttributeRight {
            owner: owner.to_owned(),
            attribute: attribute.to_owned(),
        })
    }
}

fn rule(text: &str, place: Range<usize>) -> RuleRight {
    let actor = text
        .strip_prefix("agent(")
        .and_then(|t| t.strip_suffix(')'));
    match actor {
        _ if text == ANY => RuleRight::Every,
        Some(actor) => RuleRight::Of(actor.trim().to_owned()),
        None => RuleRight::Named(text.to_owned(), place),
    }
}

impl Manifest {
    /// Reads a manifest file: `agent` is whose it is; `nodes` the types of the nodes that it may
    /// create, delete and retype; `edges` the labels that it may create and delete; `attributes`
    /// those that it may write, each as OWNER.ATTRIBUTE; `rules` those that it may apply, by name
    /// or as `agent(NAME)`. `*` stands for every name. `several = true` lets several processes go
    /// by the name at once.
    ///
    /// # Errors
    /// Broken TOML, unknown keys, and names that the schema does not have; all at once.
    pub fn from_toml(file_name: &str, text: &str, schema: &Schema) -> Result<Self, ManifestError> {
        let error = |defects| ManifestError {
            text: NamedSource::new(file_name, text.to_owned()),
            defects,
        };
        let file: File = toml::from_str(text).map_err(|e| {
            error(vec![Defect {
                message: e.message().to_owned(),
                span: e.span().map(Into::into),
                help: None,
            }])
        })?;
        let mut reader = Reader {
            schema,
            defects: Vec::new(),
        };
        if file.agent.get_ref().is_empty() {
            let message = "an agent has a name".to_owned();
            reader.note(message, file.agent.span(), None);
        }
        let types: Vec<String> = reader.types().map(str::to_owned).collect();
        let labels: Vec<String> = reader.labels().map(str::to_owned).collect();
        let rules = file.rules.iter();
        let rules = rules
            .map(|text| rule(text.get_ref(), text.span()))
            .collect();
        let manifest = Self {
            agent: file.agent.get_ref().clone(),
            nodes: reader.names("node type", &file.nodes, &types),
            edges: reader.names("edge label", &file.edges, &labels),
            attributes: file
                .attributes
                .iter()
                .filter_map(|text| reader.attribute(text))
                .collect(),
            rules,
            several: file.several,
        };
        if reader.defects.is_empty() {
            Ok(manifest)
        } else {
            Err(error(reader.defects))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schema() -> Schema {
        let text = "[types]\nthing = []\nrobot = [\"thing\"]\n[labels]\nin = {}\n\
                    [attributes]\nradius = { kind = \"f64\" }\n";
        Schema::from_toml("schema.toml", text).unwrap()
    }

    #[test]
    fn all_faults_are_told_at_once_each_with_its_place() {
        let text = "agent = \"driver\"\nnodes = [\"robto\", \"*\"]\nedges = [\"inn\"]\n\
                    attributes = [\"robot.raduis\", \"radius\", \"*.radius\", \"in.radius\"]\n";
        let error = Manifest::from_toml("driver.toml", text, &schema()).unwrap_err();
        let told: Vec<_> = error
            .defects
            .iter()
            .map(|defect| {
                let span = defect.span.unwrap();
                let place = &text[span.offset()..span.offset() + span.len()];
                (place, defect.message.as_str(), defect.help.as_deref())
            })
            .collect();
        assert_eq!(
            told,
            [
                (
                    "\"robto\"",
                    "unknown node type `robto`",
                    Some("did you mean `robot`?")
                ),
                (
                    "\"inn\"",
                    "unknown edge label `inn`",
                    Some("did you mean `in`?")
                ),
                (
                    "\"robot.raduis\"",
                    "unknown attribute `raduis`",
                    Some("did you mean `radius`?")
                ),
                (
                    "\"radius\"",
                    "`radius` does not say whose attribute it is",
                    Some("write OWNER.ATTRIBUTE, where OWNER is a type, a label or `*`")
                ),
            ]
        );
        assert_eq!(error.to_string(), "4 faults in the manifest");
    }

    #[test]
    fn an_unknown_key_is_pointed_at() {
        let text = "agent = \"a\"\nnoods = []\n";
        let error = Manifest::from_toml("a.toml", text, &schema()).unwrap_err();
        let span = error.defects[0].span.unwrap();
        assert_eq!(&text[span.offset()..span.offset() + span.len()], "noods");
    }

    #[test]
    fn rules_are_given_by_name_by_agent_or_all() {
        assert_eq!(rule("*", 0..3), RuleRight::Every);
        assert_eq!(rule("agent(driver)", 0..15), RuleRight::Of("driver".into()));
        assert_eq!(rule("goTo", 2..8), RuleRight::Named("goTo".into(), 2..8));
    }
}
