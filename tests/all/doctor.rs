//! `cortex doctor` as its users meet it.

use crate::support::Program;
use serde_json::Value;
use std::fs::{self, Permissions};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

const FOLDER: &str = "runtime folder";

/// A store of the instance of that name, in that folder.
fn store(runtime: &Path, name: &str) -> Child {
    let mut store = Command::new(env!("CARGO_BIN_EXE_peer"))
        .args(["store", name])
        .env("CORTEX_RUNTIME_DIR", runtime)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut output = BufReader::new(store.stdout.as_mut().unwrap());
    output.read_line(&mut line).unwrap();
    assert_eq!(line.trim_end(), "ready");
    store
}

/// What it says of the instance, and whether the exit code is that of its being well.
fn told(runtime: &Path, name: &str, flags: &[&str]) -> (Value, Option<i32>) {
    let output = Program::command(&[&["doctor", "--json"], flags].concat())
        .env("CORTEX_RUNTIME_DIR", runtime)
        .output()
        .unwrap();
    let findings: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    for finding in &findings {
        assert_eq!(finding["ok"], finding["mend"].is_null(), "{finding}");
        assert!(finding["found"].is_string(), "{finding}");
    }
    let check = match name {
        FOLDER => Value::from(FOLDER),
        name => Value::from(format!("instance {name}")),
    };
    let mut found = findings.into_iter();
    let found = found.find(|finding| finding["check"] == check);
    (found.unwrap_or_default(), output.status.code())
}

#[test]
fn the_doctor_finds_and_mends_what_was_left_and_what_is_open_and_leaves_the_living_alone() {
    let runtime = tempfile::tempdir().unwrap();
    let name = "patient";
    assert_eq!(told(runtime.path(), name, &[]).0, Value::Null);
    let mut living = store(runtime.path(), name);
    let (finding, _) = told(runtime.path(), name, &["--mend"]);
    assert_eq!(finding["found"], "1 processes");
    // The memory of it is named by where it lies, so that it is found by what is in use.
    let memory = || -> Vec<_> {
        let maps = fs::read_to_string(format!("/proc/{}/maps", living.id())).unwrap();
        let lines = maps.lines().filter_map(|line| line.split_once("/dev/shm/"));
        lines
            .map(|(_, file)| Path::new("/dev/shm").join(file))
            .collect()
    };
    let open = memory().remove(0);
    let mode = fs::metadata(&open).unwrap().permissions();
    fs::set_permissions(&open, Permissions::from_mode(mode.mode() | 0o006)).unwrap();
    let (finding, code) = told(runtime.path(), name, &[]);
    assert!(
        finding["found"].as_str().unwrap().contains("other users"),
        "{finding}"
    );
    assert_eq!((finding["ok"].as_bool(), code), (Some(false), Some(1)));
    assert_eq!(told(runtime.path(), name, &["--mend"]).0["ok"], true);
    assert_eq!(fs::metadata(&open).unwrap().permissions().mode() & 0o077, 0);
    living.kill().unwrap();
    living.wait().unwrap();
    let (finding, code) = told(runtime.path(), name, &[]);
    assert!(
        finding["found"]
            .as_str()
            .unwrap()
            .contains("left version 1 of its graph"),
        "{finding}"
    );
    assert_eq!(code, Some(1));
    assert_eq!(told(runtime.path(), name, &["--mend"]).0["ok"], true);
    assert!(!open.exists());
    assert_eq!(told(runtime.path(), name, &[]).0, Value::Null);
}

#[test]
fn the_doctor_finds_a_runtime_folder_that_no_store_will_use() {
    let runtime = tempfile::tempdir().unwrap();
    assert_eq!(told(runtime.path(), FOLDER, &[]).0, Value::Null);
    let user = rustix::process::getuid().as_raw();
    let folder = runtime.path().join(format!("cortex-{user}"));
    fs::create_dir(&folder).unwrap();
    for (mode, ok) in [(0o700, true), (0o755, false)] {
        fs::set_permissions(&folder, Permissions::from_mode(mode)).unwrap();
        let (finding, _) = told(runtime.path(), FOLDER, &[]);
        assert_eq!(finding["ok"], ok, "{finding}");
    }
}
