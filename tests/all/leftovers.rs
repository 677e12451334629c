//! What processes that were killed at the worst moment leave in an instance: nobody waits for it, and
//! it is removed while the store runs.

use crate::support::{Process, TestInstance, pause, size, within};
use dsr::{Filter, Session, Time, Transaction};
use std::collections::BTreeSet;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);
/// The mode of shared memory that is being made, as iceoryx2 has it.
const MEMORY_BEING_MADE: u32 = 0o200;
/// And of a file.
const FILE_BEING_MADE: u32 = 0o600;

/// Every file and folder of the instance, but for those that one of the tests' processes holds.
fn everything(instance: &TestInstance) -> BTreeSet<PathBuf> {
    fn below(folder: &Path, found: &mut BTreeSet<PathBuf>) {
        // What goes meanwhile is not there.
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.path().is_dir() {
                below(&entry.path(), found);
            }
            found.insert(entry.path());
        }
    }
    let mut found: BTreeSet<PathBuf> = instance.0.shared_memory().unwrap().into_iter().collect();
    below(instance.0.folder(), &mut found);
    found
}

/// Numbers that look drawn, the same in every run.
struct Draw(u64);

impl Draw {
    /// The next one, below `end`.
    fn below(&mut self, end: u64) -> u64 {
        // Knuth's multiplier; the upper bits are the better mixed.
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) % end
    }
}

/// A commit and each kind of port.
fn use_all(session: &mut Session) {
    session
        .commit(&Transaction::new(), Time::default())
        .unwrap();
    let sender = session.publisher::<u64>("numbers").unwrap();
    let mut receiver = session.subscriber::<u64>("numbers").unwrap();
    sender.send(&7).unwrap();
    assert_eq!(receiver.receive().unwrap(), Some(7));
    session.changes(Filter::default()).unwrap();
}

#[test]
fn processes_that_are_killed_while_they_join_leave_room_for_others() {
    let instance = TestInstance::new("killed");
    let store = Process::peer("store", &instance);
    let before = everything(&instance);
    // More than may be there at once.
    let kills = size("CORTEX_KILLS", 80);
    let mut draw = Draw(1);
    for _ in 0..kills {
        let joining = Process::start("join", &instance, &[]);
        pause(Duration::from_micros(draw.below(25_000)));
        joining.kill();
    }
    let mut session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    use_all(&mut session);
    drop(session);
    let only_the_living = (0..PATIENCE.as_secs()).any(|_| {
        // Whoever comes and goes has the store look whom it is connected to, a moment later.
        Process::peer("join", &instance).finish();
        let cleaned = || (everything(&instance) == before).then_some(());
        within(Duration::from_secs(1), cleaned).is_some()
    });
    let left: Vec<_> = everything(&instance).difference(&before).cloned().collect();
    assert!(only_the_living, "{left:#?}");
    // All the places are free again.
    let guests: Vec<Process> = (0..MEMBERS)
        .map(|_| Process::peer("follow", &instance))
        .collect();
    for guest in guests {
        guest.finish();
    }
    store.finish();
}

/// Processes that an instance has room for, beside its store.
const MEMBERS: usize = 63;

#[test]
fn what_a_killed_process_had_half_made_holds_nobody_up() {
    let instance = TestInstance::new("half-made");
    let store = Process::peer("store", &instance);
    let guest = Process::peer("join", &instance);
    // In this order, so that there is nobody who cleans.
    store.kill();
    guest.kill();
    let planted = plant(&instance);
    let store = Process::start("store", &instance, &[]);
    let mut session = Session::attach(&instance.0, "agent", PATIENCE).unwrap();
    use_all(&mut session);
    let gone = within(PATIENCE, || {
        planted.iter().all(|path| !path.exists()).then_some(())
    });
    let left: Vec<_> = planted.iter().filter(|path| path.exists()).collect();
    assert!(gone.is_some(), "{left:#?}");
    drop(session);
    store.finish();
}

/// Puts into an instance whose processes were all killed what they may have been making at that moment,
/// and tells what of it shall be gone later.
fn plant(instance: &TestInstance) -> Vec<PathBuf> {
    let ends_with = |end: &str| -> Vec<PathBuf> {
        let all = everything(instance).into_iter();
        all.filter(|path| path.to_string_lossy().ends_with(end))
            .collect()
    };
    let make = |path: &Path, mode: u32, content: &[u8]| {
        fs::write(path, content).unwrap();
        fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    };
    let mut planted = Vec::new();
    // Connections without a size, and without content.
    let connection = ends_with(".connection").remove(0);
    let ids = connection.to_str().unwrap().match_indices('_');
    let (start, _) = ids
        .map(|(at, _)| connection.to_str().unwrap().split_at(at))
        .nth(1)
        .unwrap();
    for tag in ends_with(".port_tag") {
        let port: u128 = tag
            .to_str()
            .unwrap()
            .rsplit('.')
            .nth(1)
            .unwrap()
            .parse()
            .unwrap();
        let (near, far) = (port + 1, port + 2);
        let connection = |other| PathBuf::from(format!("{start}_{port}_{other}.connection"));
        make(&connection(near), MEMORY_BEING_MADE, &[]);
        make(&connection(far), MEMORY_BEING_MADE, &[0; 4096]);
        // A tag of another port of that node.
        let name = tag
            .to_str()
            .unwrap()
            .replace(&port.to_string(), &near.to_string());
        make(Path::new(&name), FILE_BEING_MADE, &[]);
        planted.extend([connection(near), connection(far), name.into()]);
    }
    // A node that has no lock yet.
    let node = ends_with(".details").remove(0);
    let id = node
        .parent()
        .unwrap()
        .file_name()
        .unwrap()
        .to_str()
        .unwrap();
    let id: u128 = id.parse().unwrap();
    let folder = instance.0.folder().join("nodes").join((id + 1).to_string());
    fs::create_dir(&folder).unwrap();
    make(
        &folder.join(node.file_name().unwrap()),
        FILE_BEING_MADE,
        &[],
    );
    planted.push(folder);
    // And one that has its lock, but not its details.
    let folder = instance.0.folder().join("nodes").join((id + 2).to_string());
    fs::create_dir(&folder).unwrap();
    planted.push(folder);
    for end in ["", "_owner_lock", "_context"] {
        let lock = ends_with(&format!(".{id}.node_monitor{end}")).remove(0);
        let text = lock.to_str().unwrap();
        let other = PathBuf::from(text.replace(&id.to_string(), &(id + 2).to_string()));
        fs::copy(&lock, &other).unwrap();
        planted.push(other);
    }
    // Services without their memory, with memory that has no size, and without content.
    for (i, memory) in ends_with(".dynamic").iter().enumerate() {
        fs::remove_file(memory).unwrap();
        match i % 3 {
            0 => {}
            1 => make(memory, MEMORY_BEING_MADE, &[]),
            _ => make(memory, MEMORY_BEING_MADE, &[0; 64]),
        }
    }
    // And the counter of nodes.
    let counter = ends_with(".global_mgmt").remove(0);
    fs::remove_file(&counter).unwrap();
    make(&counter, MEMORY_BEING_MADE, &[]);
    planted
}
