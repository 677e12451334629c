//! `cortex rules`: what a grammar says, what is wrong with it, where its rules hold in a world and
//! what they would change there. Nothing here writes to any file.

mod amounts;
mod apply;
mod check;
mod explain;
mod load;
mod matching;

use super::graph::{attach, read_graph};
use super::output::{print, print_json, tell};
use crate::cli::{Rules as Arguments, RulesAction, WorldArgs};
use crate::{Answer, Failure};
use dsr::{Graph, NodeId, Session, Snapshot};
use grammar::{
    Binding, Combo, ComboStep, Defects, Diagnostic, Grammar, MatchError, Name, Problem, Rule,
    Severity, Sound, Unfolded,
};
use serde_json::{Map, Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let json = arguments.json;
    match &arguments.action {
        RulesAction::Check {
            file,
            schema,
            world,
            manifest,
            conflicts,
        } => {
            let beside = check::Beside {
                schema: schema.as_deref(),
                world: world.as_deref(),
                manifests: manifest,
            };
            check::check(file, &beside, *conflicts, json)
        }
        RulesAction::List { file } => list(file, json),
        RulesAction::Fmt { file } => format(file, json),
        RulesAction::Match {
            file,
            rule,
            world,
            count,
            limit,
        } => {
            let listed = if *count { None } else { Some(*limit) };
            matching::matches(file, rule.as_deref(), world, listed, json)
        }
        RulesAction::Explain { file, rule, world } => {
            explain::explain(file, rule.as_deref(), world.as_deref(), json)
        }
        RulesAction::Apply {
            file,
            rule,
            world,
            dry_run,
            bind,
        } => apply::apply(file, rule, world, *dry_run, bind, json),
        RulesAction::Export { file, rule, .. } => export(file, rule.as_deref(), json),
        RulesAction::Load { file, instance } => load::load(file, &instance.instance, json),
    }
}

/// Whether a file is a goal by its name.
fn is_goal(file: &Path) -> bool {
    file.extension()
        .is_some_and(|extension| extension == "aggt")
}

fn read(file: &Path) -> Result<(Grammar, Vec<Diagnostic>), Failure> {
    if is_goal(file) {
        let message = format!(
            "{} is a goal, and a grammar (.aggl) is expected",
            file.display()
        );
        let help =
            "`cortex rules check` checks a goal, `cortex plan RULES WORLD GOAL` plans for it";
        return Err(Failure::input_with_help(message, help));
    }
    Ok(super::read_grammar(&super::read_text(file)?, file))
}

/// The grammar, without the rules that cannot be used because of an error: those are told, and do not keep
/// others from being used. If that one rule is asked for, or nothing is left, they are the failure.
fn load(file: &Path, rule: Option<&str>) -> Result<Grammar, Failure> {
    let (grammar, mut diagnostics) = read(file)?;
    if !grammar::has_errors(&diagnostics) {
        return Ok(grammar);
    }
    let failure = |diagnostics| Err(Failure::Input(Defects { diagnostics }.into()));
    let sound = match grammar.sound(&diagnostics) {
        Ok(sound) => sound,
        Err(why) => {
            tell(&format!("{why}\n"));
            return failure(diagnostics);
        }
    };
    let listed = |names: &[Name]| {
        let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        names.join(", ")
    };
    let Sound {
        grammar,
        left_out,
        missing,
        dependent,
    } = sound;
    let mut told = Vec::new();
    if !missing.is_empty() {
        let files = listed(&missing);
        told.push(format!(
            "{files} and types there that inherit from those here"
        ));
    }
    if !dependent.is_empty() {
        let rules = listed(&dependent);
        told.push(format!("{rules}, whose types may be declared there"));
    }
    if !left_out.is_empty() {
        told.push(format!("the broken rules {}", listed(&left_out)));
    }
    let tell_of = |all: &[String]| {
        for what in all {
            tell(&format!("warning: without {what}\n"));
        }
    };
    let asked = rule.is_some_and(|rule| {
        let mut unusable = left_out.iter().chain(&dependent);
        unusable.any(|name| *name == *rule) && grammar.rule(rule).is_none()
    });
    if asked || grammar.all_rules().next().is_none() {
        if !dependent.is_empty() {
            tell_of(&told);
        }
        return failure(diagnostics);
    }
    diagnostics.retain(|diagnostic| diagnostic.severity() == Severity::Error);
    warn(diagnostics);
    tell_of(&told);
    Ok(grammar)
}

/// So many findings are listed for machines, and so many characters of each.
const DIAGNOSTICS_LIMIT: usize = 2_000;
const MESSAGE_LIMIT: usize = 2_000;

/// The beginning of a message: it can quote a pattern of any length.
fn clipped(message: &str) -> String {
    match message.char_indices().nth(MESSAGE_LIMIT) {
        Some((end, _)) => format!(
            "{} ... and {} more bytes",
            &message[..end],
            message.len() - end
        ),
        None => message.to_owned(),
    }
}

/// Puts findings into an answer for machines: `diagnostics`, and in `diagnostics_left` how many more there are.
fn put_diagnostics(object: &mut Json, diagnostics: &[Diagnostic]) {
    let row = |diagnostic: &Diagnostic| {
        let (line, column) = diagnostic.line_and_column();
        let message = match diagnostic.problem.help() {
            Some(help) => format!("{diagnostic} ({help})"),
            None => diagnostic.to_string(),
        };
        json!({
            "severity": diagnostic.severity().to_string(), "file": diagnostic.file.name(),
            "line": line, "column": column, "message": clipped(&message),
        })
    };
    let rows = diagnostics.iter().take(DIAGNOSTICS_LIMIT).map(row);
    object["diagnostics"] = rows.collect();
    object["diagnostics_left"] = json!(diagnostics.len().saturating_sub(DIAGNOSTICS_LIMIT));
}

/// Says what is suspicious or wrong without ending the verb.
fn warn(diagnostics: Vec<Diagnostic>) {
    if !diagnostics.is_empty() {
        tell(&format!("{}\n", Defects { diagnostics }));
    }
}

/// A cost as it is where it is a number, else as it is written.
fn cost_json(rule: &Rule) -> Json {
    rule.cost
        .as_number()
        .map_or_else(|| json!(rule.cost.to_string()), |cost| json!(cost))
}

fn rule_json(rule: &Rule) -> Json {
    let nodes = |nodes: &mut dyn Iterator<Item = &grammar::PatternNode>| -> Vec<Json> {
        nodes
            .map(|n| json!({"name": &*n.variable, "type": &*n.type_name}))
            .collect()
    };
    json!({
        "name": &*rule.name,
        "active": rule.kind == grammar::Kind::Active,
        "cost": cost_json(rule),
        "parameters": nodes(&mut rule.parameters.iter()),
        "variables": nodes(&mut rule.bound_nodes()),
        "agent": rule.agent.as_deref(),
        "success": rule.success,
        "dormant": rule.dormant,
        "hierarchical": rule.hierarchical,
        "combo": false,
    })
}

/// The rules that a combo stands for.
fn variants<'a>(grammar: &'a Grammar, combo: &'a Combo) -> impl Iterator<Item = &'a Unfolded> {
    let unfolded = grammar.unfolded.iter();
    unfolded.filter(move |variant| variant.combo == combo.name)
}

fn combo_json(grammar: &Grammar, combo: &Combo) -> Json {
    let variant = |variant: &Unfolded| {
        let steps = variant.steps.iter().map(|step| step.alias.as_str());
        let mut row = rule_json(&variant.rule);
        row["steps"] = json!(steps.collect::<Vec<_>>());
        row
    };
    let variants: Vec<Json> = variants(grammar, combo).map(variant).collect();
    let steps: Vec<Json> = combo
        .steps
        .iter()
        .map(|s| json!({"rule": &*s.rule, "alias": &*s.alias, "optional": s.optional}))
        .collect();
    json!({
        "name": &*combo.name,
        "active": combo.kind == grammar::Kind::Active,
        "cost": combo.cost,
        "parameters": [],
        "combo": true,
        "steps": steps,
        "variants": variants,
    })
}

/// The variables of a rule with their types.
fn words_of_nodes(rule: &Rule) -> String {
    let nodes = rule.bound_nodes();
    let nodes = nodes.map(|node| format!("{}:{}", node.variable, node.type_name));
    nodes.collect::<Vec<_>>().join(" ")
}

fn list(file: &Path, as_json: bool) -> Result<Answer, Failure> {
    let (grammar, diagnostics) = read(file)?;
    let sound = grammar.sound(&diagnostics).ok();
    let broken = |name: &Name| {
        let is_there = |sound: &Sound| {
            sound.grammar.rules.iter().any(|rule| rule.name == *name)
                || sound.grammar.combos.iter().any(|combo| combo.name == *name)
        };
        grammar::has_errors(&diagnostics) && !sound.as_ref().is_some_and(is_there)
    };
    if as_json {
        let rules = grammar.rules.iter().map(|rule| {
            let mut row = rule_json(rule);
            row["broken"] = json!(broken(&rule.name));
            row
        });
        let combos = grammar.combos.iter();
        let combos = combos.map(|combo| {
            let mut row = combo_json(&grammar, combo);
            row["broken"] = json!(broken(&combo.name));
            row
        });
        let types = grammar.types.names().chain(grammar.types.undeclared());
        let mut types: Vec<&str> = types.map(|name| &**name).collect();
        let mut seen = BTreeSet::new();
        types.retain(|name| seen.insert(*name));
        let rules: Vec<Json> = rules.chain(combos).collect();
        let mut object = json!({ "types": types, "rules": rules });
        put_diagnostics(&mut object, &diagnostics);
        print_json(&object)?;
        return Ok(Answer::Yes);
    }
    let mark = |name: &Name| if broken(name) { "broken " } else { "" };
    let mut text = String::new();
    for declaration in &grammar.types.declarations {
        let names = |names: &[grammar::Name]| {
            names
                .iter()
                .map(|name| &**name)
                .collect::<Vec<&str>>()
                .join(" ")
        };
        let parents = match names(&declaration.parents) {
            none if none.is_empty() => String::new(),
            parents => format!(" : {parents}"),
        };
        // Writing to a string does not fail.
        let _ = writeln!(text, "type {}{parents}", names(&declaration.names));
    }
    for rule in &grammar.rules {
        let agent = rule
            .agent
            .as_ref()
            .map_or_else(String::new, |agent| format!(", by {agent}"));
        let _ = writeln!(
            text,
            "{}rule {} : {}, cost {}{agent}  ({})",
            mark(&rule.name),
            rule.name,
            rule.kind,
            rule.cost,
            words_of_nodes(rule)
        );
    }
    for combo in &grammar.combos {
        let step = |step: &ComboStep| {
            let optional = if step.optional { " optional" } else { "" };
            format!("{} as {}{optional}", step.rule, step.alias)
        };
        let steps: Vec<String> = combo.steps.iter().map(step).collect();
        let (name, kind, cost) = (&combo.name, combo.kind, combo.cost);
        let _ = writeln!(
            text,
            "{}combo {name} : {kind}, cost {cost}  ({})",
            mark(name),
            steps.join(", ")
        );
        for variant in variants(&grammar, combo) {
            let nodes = words_of_nodes(&variant.rule);
            let _ = writeln!(text, "    as rule {}  ({nodes})", variant.rule.name);
        }
    }
    print(&text)?;
    warn(diagnostics);
    Ok(Answer::Yes)
}

fn format(file: &Path, as_json: bool) -> Result<Answer, Failure> {
    if is_goal(file) {
        let text = grammar::format_goal(&super::read_text(file)?, &file.display().to_string());
        let text = text.map_err(|defects| Failure::Input(defects.into()))?;
        return formatted(&text, as_json);
    }
    let (grammar, diagnostics) = read(file)?;
    // What cannot be read would be lost. An included file is not printed: it may be missing.
    let main = grammar.files.first().map(grammar::SourceFile::name);
    let (lost, rest): (Vec<Diagnostic>, Vec<Diagnostic>) = diagnostics.into_iter().partition(|d| {
        d.severity() == Severity::Error
            && !matches!(d.problem, Problem::Include { .. })
            && Some(d.file.name()) == main
    });
    if !lost.is_empty() {
        return Err(Failure::Input(Defects { diagnostics: lost }.into()));
    }
    warn(rest);
    formatted(&grammar.to_string(), as_json)
}

fn formatted(text: &str, as_json: bool) -> Result<Answer, Failure> {
    if as_json {
        print_json(&json!({ "text": text }))?;
    } else {
        print(text)?;
    }
    Ok(Answer::Yes)
}

fn find_rule<'a>(grammar: &'a Grammar, name: &str) -> Result<&'a Rule, Failure> {
    if let Some(rule) = grammar.rule(name) {
        return Ok(rule);
    }
    if grammar.combos.iter().any(|combo| combo.name == *name) {
        let message = format!("the combo `{name}` cannot be applied as one rule");
        let help = "`cortex rules check` says why; name one of the rules that it is made of";
        return Err(Failure::input_with_help(message, help));
    }
    let known = dsr::suggest(name, grammar.all_rules().map(|rule| &*rule.name));
    let help = known.map_or_else(
        || "`cortex rules list` lists what there is".to_owned(),
        |known| format!("did you mean `{known}`?"),
    );
    Err(Failure::input_with_help(
        format!("there is no rule `{name}`"),
        help,
    ))
}

/// A world that rules are tried on: a file's, or that of a running system.
enum World {
    File(Box<Graph>),
    Live(Box<Session>),
}

impl World {
    fn open(arguments: &WorldArgs) -> Result<Self, Failure> {
        match (&arguments.world, &arguments.instance) {
            (Some(path), _) => Ok(Self::File(Box::new(read_graph(path)?))),
            (None, Some(instance)) => Ok(Self::Live(Box::new(attach(instance)?))),
            (None, None) => Err(Failure::input("say which --world or --instance")),
        }
    }

    fn snapshot(&mut self) -> Result<Snapshot, Failure> {
        match self {
            Self::File(graph) => Ok(graph.snapshot()),
            Self::Live(session) => session.snapshot().map_err(Failure::internal),
        }
    }
}

fn export(file: &Path, rule: Option<&str>, as_json: bool) -> Result<Answer, Failure> {
    let grammar = load(file, rule)?;
    let rules: Vec<&Rule> = match rule {
        Some(name) => vec![find_rule(&grammar, name)?],
        None => grammar.all_rules().collect(),
    };
    let text: String = rules.into_iter().map(Rule::to_dot).collect();
    if as_json {
        print_json(&json!({ "dot": text }))?;
    } else {
        print(&text)?;
    }
    Ok(Answer::Yes)
}

/// Names of nodes, each read once.
struct Names<'a> {
    snapshot: &'a Snapshot,
    known: BTreeMap<NodeId, String>,
}

impl<'a> Names<'a> {
    fn new(snapshot: &'a Snapshot) -> Self {
        Self {
            snapshot,
            known: BTreeMap::new(),
        }
    }

    fn of(&mut self, id: NodeId) -> Result<String, Failure> {
        if let Some(name) = self.known.get(&id) {
            return Ok(name.clone());
        }
        let node = self.snapshot.find_node(id).map_err(Failure::internal)?;
        let name = node
            .map(|node| node.name())
            .transpose()
            .map_err(Failure::internal)?;
        let name = name.unwrap_or_else(|| format!("node {id}"));
        self.known.insert(id, name.clone());
        Ok(name)
    }

    fn of_all(&mut self, binding: &Binding) -> Result<Map<String, Json>, Failure> {
        let pairs = binding.iter();
        pairs
            .map(|(variable, id)| Ok((variable.to_string(), self.of(id)?.into())))
            .collect()
    }
}

/// The names of a binding in the order of the rule, for people.
fn words(rule: &Rule, named: &Map<String, Json>) -> String {
    let pairs = rule.bound_nodes().filter_map(|node| {
        let name = named.get(&*node.variable)?.as_str()?;
        Some(format!("{}={name}", node.variable))
    });
    pairs.collect::<Vec<_>>().join(" ")
}

/// Why matching failed: a rule that asks for too much is the user's, all else is not.
fn unmatched(error: MatchError) -> Failure {
    match error {
        MatchError::Limit { .. } => Failure::input_with_help(
            error.to_string(),
            "join the nodes of the rule by links, or nest fewer quantifiers",
        ),
        other => Failure::internal(other),
    }
}
