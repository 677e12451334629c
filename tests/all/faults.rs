//! What others can do to an instance: processes that start at once, that are killed or stopped
//! at the worst moment, other users, memory that is full.

use crate::support::{Process, Program, TestInstance};
use dsr::{Instance, Schema, Session, Store};
use rustix::process::{Pid, Signal, geteuid, kill_process};
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);
const CARE_CENTRE: &str = "scenarios/care-centre";
/// A user that owns nothing.
const NOBODY: u32 = 65_534;

/// Every file and folder of the instance.
fn files(instance: &Instance) -> Vec<PathBuf> {
    fn below(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                below(&path, found);
            }
            found.push(path);
        }
    }
    let mut found = instance.shared_memory().unwrap();
    below(instance.folder(), &mut found);
    found
}

#[test]
fn no_other_user_can_read_or_write_anything_of_an_instance() {
    let instance = TestInstance::new("modes");
    let mut store = Store::open(&instance.0, Schema::open()).unwrap();
    store.serve(Duration::ZERO).unwrap();
    let session = Session::join(&instance.0, "agent").unwrap();
    let channel = session.publisher::<u64>("numbers").unwrap();
    let heard = session.subscriber::<u64>("numbers").unwrap();
    channel.send(&1).unwrap();
    store.serve(Duration::ZERO).unwrap();
    let folder = instance.0.folder();
    for private in [folder, folder.parent().unwrap()] {
        let mode = fs::metadata(private).unwrap().permissions().mode();
        assert_eq!(mode & 0o7777, 0o700, "{}", private.display());
    }
    let memory = instance.0.shared_memory().unwrap();
    assert!(memory.len() > 10, "{memory:?}");
    for path in &memory {
        let mode = fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", path.display());
    }
    // The proof of it, where this test may act as another user.
    if geteuid().is_root() {
        for path in files(&instance.0) {
            for test in ["-r", "-w"] {
                let mut command = Command::new("test");
                command.arg(test).arg(&path).uid(NOBODY).gid(NOBODY);
                let may = command.status().unwrap();
                assert!(!may.success(), "another user: {test} {}", path.display());
            }
        }
    }
    drop((channel, heard, session, store));
}

#[test]
fn a_file_that_another_user_has_put_in_the_way_is_told() {
    let instance = TestInstance::new("foreign");
    drop(Session::join(&instance.0, "agent").unwrap());
    let left = instance.0.shared_memory().unwrap();
    let [open] = left.as_slice() else {
        panic!("{left:?}")
    };
    // Only root may give a file away; others see that one which they own is closed again.
    fs::set_permissions(open, fs::Permissions::from_mode(0o666)).unwrap();
    drop(Session::join(&instance.0, "agent").unwrap());
    assert_eq!(fs::metadata(open).unwrap().mode() & 0o777, 0o600);
    if geteuid().is_root() {
        chown(open, Some(NOBODY), Some(NOBODY)).unwrap();
        let error = Session::join(&instance.0, "agent").unwrap_err().to_string();
        assert!(error.contains("belongs to another user"), "{error}");
        chown(open, Some(0), Some(0)).unwrap();
    }
}

#[test]
fn processes_that_are_started_at_once_all_join() {
    for _ in 0..3 {
        let instance = TestInstance::new("at-once");
        let start = |role| Process::start(role, &instance, &[]);
        let mut peers: Vec<Process> = (0..4).map(|_| start("join")).collect();
        peers.push(start("store"));
        peers.extend((0..4).map(|_| start("join")));
        for peer in &mut peers {
            assert_eq!(peer.line(), "ready");
        }
        for peer in peers {
            peer.finish();
        }
    }
}

fn send(signal: Signal, to: &Child) {
    let id = Pid::from_raw(to.id().cast_signed()).unwrap();
    kill_process(id, signal).unwrap();
}

/// Its status; killed where it does not end in time.
fn end_of(mut child: Child) -> ExitStatus {
    let ended = crate::support::within(PATIENCE, || child.try_wait().unwrap());
    ended.unwrap_or_else(|| {
        child.kill().unwrap();
        panic!("{child:?} did not end")
    })
}

#[test]
fn a_store_and_agents_that_were_started_by_hand_end_at_a_signal_and_leave_nothing() {
    for signal in [Signal::INT, Signal::TERM] {
        let instance = TestInstance::new("by-hand");
        let name = instance.name().to_owned();
        let start = |verb: &[&str]| {
            let common = ["--scenario", CARE_CENTRE, "--instance", &name];
            let arguments = [verb, &common].concat();
            let mut command = Program::command(&arguments);
            command.stderr(Stdio::null()).spawn().unwrap()
        };
        // All at once, and those that are first wait for the store.
        let agents = ["navigation", "executive", "human_observer", "world"];
        let agents = agents.map(|agent| start(&["agent", agent]));
        let store = start(&["store"]);
        let mut session = Session::attach(&instance.0, "watch", PATIENCE).unwrap();
        // The executive has entered its missions: it has joined and takes turns.
        let running = crate::support::within(PATIENCE, || {
            let snapshot = session.snapshot().unwrap();
            let mission = snapshot.schema().find_type("mission")?;
            (snapshot.count_of_type(mission).unwrap() > 0).then_some(())
        });
        assert!(running.is_some(), "the agents do not run");
        drop(session);
        for process in agents.into_iter().chain([store]) {
            send(signal, &process);
            assert_eq!(end_of(process).code(), Some(0));
        }
        assert_eq!(instance.0.shared_memory().unwrap(), Vec::<PathBuf>::new());
        assert!(!instance.0.folder().exists());
    }
}

#[test]
fn an_agent_that_waits_for_a_store_ends_at_a_signal() {
    let instance = TestInstance::new("waiting");
    let mut command = Program::command(&["agent", "navigation", "--instance", instance.name()]);
    let agent = command.stderr(Stdio::null()).spawn().unwrap();
    let joined = crate::support::within(PATIENCE, || {
        let processes = instance.0.processes().unwrap();
        processes.contains(&agent.id()).then_some(())
    });
    assert!(joined.is_some(), "the agent does not join");
    send(Signal::INT, &agent);
    assert_eq!(end_of(agent).code(), Some(0));
    assert!(!instance.0.folder().exists());
}

#[test]
fn an_instance_is_not_removed_under_a_process_that_uses_it() {
    let instance = TestInstance::new("in-use");
    let store = Process::peer("store", &instance);
    assert!(!instance.0.remove_if_unused().unwrap());
    let run = Program::run(&["run", CARE_CENTRE, "--instance", instance.name()]);
    let told = String::from_utf8(run.stderr).unwrap();
    assert!(told.contains("is in use by the processes"), "{told}");
    let session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    drop(session);
    store.finish();
    assert!(instance.0.remove_if_unused().unwrap());
    assert!(!instance.0.folder().exists());
}
