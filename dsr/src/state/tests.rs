//! The folder against the graph: whatever was committed, the folder holds the version that it was
//! last brought to, whole; and folders that are none of ours are told from damaged ones.

use super::*;
use crate::graph::tests::operation;
use crate::{Change, Graph, Operation, Refusal, Time, Transaction, Value};
use proptest::prelude::*;
use std::io::{Read, Seek, SeekFrom, Write};
use std::time::Duration;
use tempfile::TempDir;

const LIFE: Life = Life {
    epoch: Epoch(1),
    from: None,
};
const NEVER: Duration = Duration::from_hours(1);

fn image(graph: &Graph) -> Image {
    Image::of(&graph.snapshot()).unwrap()
}

/// Commits those of the operations that the graph takes, each alone.
fn commit(graph: &mut Graph, operations: Vec<Operation>) -> Vec<Change> {
    let mut changes = Vec::new();
    for (i, operation) in operations.into_iter().enumerate() {
        let transaction = Transaction {
            operations: vec![operation],
            ..Transaction::new()
        };
        let agent = format!("agent{}", i % 3);
        let time = Time::from_nanoseconds(i64::try_from(i).unwrap());
        if let Ok((_, change)) = graph.commit(&transaction, &agent, time) {
            changes.push(change);
        }
    }
    changes
}

fn touched(changes: &[Change]) -> (BTreeSet<NodeId>, BTreeSet<EdgeKey>) {
    let nodes = changes.iter().flat_map(|c| c.nodes.iter().map(|n| n.node));
    let edges = changes.iter().flat_map(|c| c.edges.iter().map(|e| e.edge));
    (nodes.collect(), edges.collect())
}

fn thing(graph: &mut Graph, name: &str) -> Result<Change, Refusal> {
    let mut transaction = Transaction::new();
    transaction.create_node("thing", name, vec![("n".into(), Value::I64(1))]);
    let outcome = graph.commit(&transaction, "agent", Time::default());
    outcome.map(|(_, change)| change)
}

/// A folder with one node in it.
fn small_state() -> (TempDir, Graph) {
    let folder = TempDir::new().unwrap();
    let mut graph = Graph::in_memory(Schema::open());
    thing(&mut graph, "one").unwrap();
    State::open(folder.path())
        .unwrap()
        .replace(&image(&graph), LIFE)
        .unwrap();
    (folder, graph)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn the_folder_holds_what_the_last_group_left_down_to_who_wrote_what_when(
        groups in prop::collection::vec(prop::collection::vec(operation(), 1..40), 1..6),
    ) {
        let folder = TempDir::new().unwrap();
        let mut state = State::open(folder.path()).unwrap();
        prop_assert!(state.load().unwrap().is_none());
        let mut graph = Graph::in_memory(Schema::open());
        state.replace(&image(&graph), LIFE).unwrap();
        let mut schema_version = graph.snapshot().root.schema_version;
        for operations in groups {
            let (nodes, edges) = touched(&commit(&mut graph, operations));
            let snapshot = graph.snapshot();
            let group = Group::read(&snapshot, schema_version, &nodes, &edges).unwrap();
            state.write(&group).unwrap();
            schema_version = snapshot.root.schema_version;
            prop_assert_eq!(state.load().unwrap().unwrap(), image(&graph));
        }
        drop(state);
        let mut state = State::open(folder.path()).unwrap();
        let loaded = state.load().unwrap().unwrap();
        let mut restored = Graph::in_memory(Schema::open());
        restored.restore(&loaded).unwrap();
        prop_assert_eq!(image(&restored), image(&graph));
        // Another graph of at least that version takes its place whole.
        let mut other = Graph::in_memory(Schema::open());
        while other.snapshot().version() < graph.snapshot().version() {
            let name = format!("other{}", other.snapshot().version());
            thing(&mut other, &name).unwrap();
        }
        state.replace(&image(&other), LIFE).unwrap();
        prop_assert_eq!(state.load().unwrap().unwrap(), image(&other));
    }

    #[test]
    fn a_keeper_that_is_overtaken_all_the_time_still_brings_everything_to_the_disk(
        operations in prop::collection::vec(operation(), 50..300),
    ) {
        let folder = TempDir::new().unwrap();
        let mut graph = Graph::in_memory(Schema::open());
        // No history at all: every commit takes the memory of the version before it.
        graph.set_limits(crate::Limits { history_bytes: 0, ..crate::Limits::default() });
        let mut state = State::open(folder.path()).unwrap();
        state.replace(&image(&graph), LIFE).unwrap();
        let keeper = Keeper::start(state, &graph.snapshot(), Duration::ZERO, Box::new(|| ()));
        let keeper = keeper.unwrap();
        for operation in operations {
            for change in commit(&mut graph, vec![operation]) {
                keeper.note(&change, graph.snapshot(), true);
            }
        }
        drop(keeper);
        let state = State::open(folder.path()).unwrap();
        prop_assert_eq!(state.load().unwrap().unwrap(), image(&graph));
    }
}

#[test]
fn an_urgent_commit_is_on_disk_when_it_is_called_durable_and_takes_the_others_along() {
    let (folder, mut graph) = small_state();
    let copy = TempDir::new().unwrap();
    let state = State::open(folder.path()).unwrap();
    let (ring, rung) = std::sync::mpsc::channel();
    let bell = Box::new(move || ring.send(()).unwrap_or_default());
    let keeper = Keeper::start(state, &graph.snapshot(), NEVER, bell).unwrap();
    // The first group is due at once, the next in an hour.
    keeper.note(
        &thing(&mut graph, "first").unwrap(),
        graph.snapshot(),
        false,
    );
    rung.recv().unwrap();
    let first = graph.snapshot().version();
    assert_eq!(keeper.durable(), first);
    keeper.note(
        &thing(&mut graph, "waits").unwrap(),
        graph.snapshot(),
        false,
    );
    assert_eq!(keeper.durable(), first);
    keeper.note(
        &thing(&mut graph, "urgent").unwrap(),
        graph.snapshot(),
        true,
    );
    rung.recv().unwrap();
    assert_eq!(keeper.durable(), graph.snapshot().version());
    // What a process that was killed now would leave.
    fs::copy(folder.path().join(FILE), copy.path().join(FILE)).unwrap();
    let left = State::open(copy.path()).unwrap();
    assert_eq!(left.load().unwrap().unwrap(), image(&graph));
    assert_eq!(keeper.failure(), None);
}

#[test]
fn a_folder_of_something_else_is_left_alone() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("thesis.tex"), "precious").unwrap();
    let error = State::open(folder.path()).unwrap_err();
    assert!(matches!(error, StateError::Foreign { .. }), "{error}");
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(names.len(), 1, "nothing was added");
    // A database of another program.
    let folder = TempDir::new().unwrap();
    let database = Database::create(folder.path().join(FILE)).unwrap();
    let write = database.begin_write().unwrap();
    write
        .open_table(TableDefinition::<u64, u64>::new("accounts"))
        .unwrap()
        .insert(1, 2)
        .unwrap();
    write.commit().unwrap();
    drop(database);
    let error = State::open(folder.path()).unwrap_err();
    assert!(matches!(error, StateError::Foreign { .. }), "{error}");
    // A file.
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let error = State::open(&file).unwrap_err();
    assert!(matches!(error, StateError::Io { .. }), "{error}");
}

#[test]
fn a_store_that_was_killed_while_it_made_the_folder_leaves_one_that_can_be_used() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join(UNFINISHED), "half of a database").unwrap();
    let state = State::open(folder.path()).unwrap();
    assert_eq!(state.load().unwrap(), None);
    assert!(!folder.path().join(UNFINISHED).exists());
}

#[test]
fn a_folder_that_another_store_has_open_is_refused() {
    let (folder, _) = small_state();
    let first = State::open(folder.path()).unwrap();
    let error = State::open(folder.path()).unwrap_err();
    assert!(matches!(error, StateError::InUse { .. }), "{error}");
    drop(first);
    State::open(folder.path()).unwrap();
}

#[test]
fn a_folder_of_another_format_is_refused_with_both_numbers() {
    let (folder, _) = small_state();
    let state = State::open(folder.path()).unwrap();
    let write = state.database.begin_write().unwrap();
    let bytes = postcard::to_stdvec(&7u32).unwrap();
    write
        .open_table(ABOUT)
        .unwrap()
        .insert(about::FORMAT, bytes.as_slice())
        .unwrap();
    write.commit().unwrap();
    drop(state);
    let error = State::open(folder.path()).unwrap_err();
    assert!(
        error
            .to_string()
            .ends_with("has format 7, and this program reads format 3"),
        "{error}"
    );
}

#[test]
fn an_older_graph_does_not_replace_a_newer_one() {
    let (folder, mut graph) = small_state();
    let older = image(&graph);
    thing(&mut graph, "two").unwrap();
    let mut state = State::open(folder.path()).unwrap();
    state.replace(&image(&graph), LIFE).unwrap();
    let error = state.replace(&older, LIFE).unwrap_err();
    assert!(matches!(error, StateError::Newer { .. }), "{error}");
    assert_eq!(state.load().unwrap().unwrap(), image(&graph));
}

#[test]
fn nobody_but_its_owner_reads_or_writes_a_state() {
    use std::os::unix::fs::PermissionsExt;
    let parent = TempDir::new().unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    let set = |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode));
    let folder = parent.path().join("a/b");
    let file = folder.join("graph.redb");
    State::open(&folder).unwrap();
    assert_eq!((mode(&folder), mode(&file)), (0o700, 0o600));
    // A folder that was there before, and a database that was copied to it.
    set(&folder, 0o755).unwrap();
    set(&file, 0o644).unwrap();
    State::open(&folder).unwrap();
    assert_eq!((mode(&folder), mode(&file)), (0o755, 0o600));
    set(&folder, 0o775).unwrap();
    let error = State::open(&folder).unwrap_err();
    assert!(matches!(error, StateError::Shared { .. }), "{error}");
    assert!(error.to_string().contains("chmod go-w"), "{error}");
}

#[test]
fn a_file_that_was_once_large_is_made_small_again() {
    let folder = TempDir::new().unwrap();
    let mut graph = Graph::in_memory(Schema::open());
    for i in 0..90 {
        let cells = Value::U8List(vec![7; 300 << 10]);
        let mut transaction = Transaction::new();
        transaction.create_node("map", &format!("map{i}"), vec![("cells".into(), cells)]);
        graph
            .commit(&transaction, "agent", Time::default())
            .unwrap();
    }
    let mut state = State::open(folder.path()).unwrap();
    state.replace(&image(&graph), LIFE).unwrap();
    let mut transaction = Transaction::new();
    // The last stays, and may lie at the end of the file.
    for i in 0..89 {
        transaction.delete_node(format!("map{i}"));
    }
    graph
        .commit(&transaction, "agent", Time::default())
        .unwrap();
    state.replace(&image(&graph), LIFE).unwrap();
    drop(state);
    let bytes = || fs::metadata(folder.path().join(FILE)).unwrap().len();
    let before = bytes();
    assert!(before > 20 << 20, "{before}");
    let state = State::open(folder.path()).unwrap();
    assert_eq!(state.load().unwrap().unwrap(), image(&graph));
    drop(state);
    assert!(bytes() < SMALL_BYTES, "{} after {before}", bytes());
}

/// Wherever a file was overwritten or cut off, it is told to be damaged, or all of it is there
/// still: what was overwritten was not in use.
#[test]
fn a_damaged_file_is_told_and_never_read_wrongly() {
    let folder = TempDir::new().unwrap();
    let mut graph = Graph::in_memory(Schema::open());
    for i in 0..200 {
        thing(&mut graph, &format!("node{i}")).unwrap();
    }
    let mut state = State::open(folder.path()).unwrap();
    state.replace(&image(&graph), LIFE).unwrap();
    drop(state);
    let path = folder.path().join(FILE);
    let whole = fs::read(&path).unwrap();
    let (mut told, mut unharmed) = (0, 0);
    for step in 0..120 {
        let at = whole.len() * step / 120 + step * 7 % 64;
        fs::write(&path, &whole).unwrap();
        if step % 10 == 9 {
            fs::File::options()
                .write(true)
                .open(&path)
                .unwrap()
                .set_len(at as u64)
                .unwrap();
        } else {
            let mut file = fs::File::options()
                .read(true)
                .write(true)
                .open(&path)
                .unwrap();
            let mut bytes = [0; 16];
            file.seek(SeekFrom::Start(at as u64)).unwrap();
            let read = file.read(&mut bytes).unwrap();
            let changed: Vec<u8> = bytes[..read].iter().map(|byte| !byte).collect();
            file.seek(SeekFrom::Start(at as u64)).unwrap();
            file.write_all(&changed).unwrap();
        }
        let outcome = State::open(folder.path()).and_then(|state| state.load());
        match outcome {
            Ok(Some(found)) => {
                assert!(found == image(&graph), "byte {at}");
                unharmed += 1;
            }
            Ok(None) => panic!("byte {at}: nothing was said to be there"),
            Err(
                StateError::Damaged { .. } | StateError::Foreign { .. } | StateError::Format { .. },
            ) => told += 1,
            Err(other) => panic!("byte {at}: {other}"),
        }
    }
    assert!(told > 5, "{told} told, {unharmed} unharmed");
}

#[test]
fn a_state_is_read_into_a_newer_schema_by_its_names_and_refused_where_it_does_not_fit() {
    let schema = |text: &str| Schema::from_toml("schema.toml", text).unwrap();
    let old = schema(
        "[types]\nroom = []\nrobot = []\n[labels]\nin = { from = [\"robot\"], to = [\"room\"] }\n\
         [attributes]\narea = { kind = \"f64\" }\n",
    );
    // The same names, in another order and with others between them.
    let new = schema(
        "[types]\ndoor = []\nrobot = []\nroom = []\n[labels]\nat = {}\n\
         in = { from = [\"robot\"], to = [\"room\"] }\n\
         [attributes]\nage = { kind = \"f64\" }\narea = { kind = \"f64\" }\n",
    );
    let mut graph = Graph::in_memory(old);
    let mut transaction = Transaction::new();
    transaction.create_node("room", "hall", vec![("area".into(), 12.5.into())]);
    transaction.create_node("robot", "shelly", vec![]);
    transaction.create_edge("shelly", "in", "hall");
    graph
        .commit(&transaction, "agent", Time::default())
        .unwrap();
    let saved = image(&graph);
    let mut restored = Graph::in_memory(new);
    restored.restore(&saved).unwrap();
    let snapshot = restored.snapshot();
    assert_eq!(snapshot.version(), saved.version());
    let hall = snapshot.find_node_by_name("hall").unwrap().unwrap();
    assert_eq!(hall.type_name(), "room");
    assert_eq!(hall.value("area").unwrap(), Some(Value::F64(12.5)));
    let label = snapshot.schema().label_id("in").unwrap();
    assert_eq!(snapshot.edges_of_label(label).count(), 1);
    assert!(snapshot.schema().find_type("door").is_some());
    let narrow = schema("[types]\nrobot = []\n");
    let refusal = Graph::in_memory(narrow).restore(&saved).unwrap_err();
    assert!(matches!(refusal, Refusal::SchemaViolation(_)), "{refusal}");
}
