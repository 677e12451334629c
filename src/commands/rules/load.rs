//! `cortex rules load`: makes a running system go by a grammar.

use super::{read, warn};
use crate::commands::graph::attach;
use crate::commands::output::{print, print_json};
use crate::{Answer, Failure};
use dsr::CommitError;
use grammar::{Defects, Severity};
use serde_json::json;
use std::path::Path;

pub(super) fn load(file: &Path, instance: &str, as_json: bool) -> Result<Answer, Failure> {
    let (grammar, mut diagnostics) = read(file)?;
    let mut session = attach(instance)?;
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    diagnostics.extend(grammar.check_schema(snapshot.schema()));
    if grammar::has_errors(&diagnostics) {
        if as_json {
            let mut object = json!({ "loaded": false });
            super::put_diagnostics(&mut object, &diagnostics);
            print_json(&object)?;
        }
        return Err(Failure::Input(Defects { diagnostics }.into()));
    }
    diagnostics.retain(|diagnostic| diagnostic.severity() == Severity::Warning);
    let mut object = json!({ "loaded": true });
    super::put_diagnostics(&mut object, &diagnostics);
    warn(diagnostics);
    let transaction = grammar.publish(&snapshot).map_err(Failure::internal)?;
    let commit = match session.commit(&transaction, snapshot.time()) {
        Ok(commit) => commit,
        // The store looks at it again: it alone says what holds.
        Err(CommitError::Refused(refusal)) => return Err(Failure::input(refusal)),
        Err(error) => return Err(Failure::internal(error)),
    };
    let rules = grammar.rules.len();
    if as_json {
        object["version"] = json!(commit.version.0);
        object["rules"] = json!(rules);
        print_json(&object)?;
    } else {
        print(&format!(
            "{rules} rules hold from version {}\n",
            commit.version
        ))?;
    }
    Ok(Answer::Yes)
}
