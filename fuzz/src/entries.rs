//! What each fuzz target does with its bytes: decodes them, and uses what came of it as the
//! program would. It guarantees nothing; that is what it is for: whatever the bytes, no function
//! here may panic or go on for ever. The tests of the workspace run the same functions.

use dsr::{
    AttributeId, Epoch, Graph, LargeHandle, NodeId, NumberKind, ReadError, Schema, Snapshot, Time,
    Transaction, Version,
};
use std::sync::OnceLock;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Commits it to an empty graph, and reads what came of it in every way.
fn commit(transaction: &Transaction) {
    let mut graph = Graph::in_memory(Schema::open());
    if graph.commit(transaction, "fuzz", Time::default()).is_ok() {
        let snapshot = graph.snapshot();
        assert!(read(&snapshot).is_ok(), "the graph's own memory is damaged");
        assert!(dsr::json::to_json(&snapshot).is_ok());
    }
}

/// Graph JSON (`dsr/1`).
pub fn graph_json(bytes: &[u8]) {
    // As under a schema that says of which kind plain numbers are.
    let schema = "[types]\n[labels]\n[attributes]\nn = { kind = \"f64\" }\n";
    if let Ok(schema) = dsr::Schema::from_toml("schema.toml", schema) {
        let text = text(bytes);
        if let Ok(world) = dsr::interchange::read(&text, &schema) {
            commit(&world.transaction());
            world.check(&text, &schema);
        }
    }
}

/// RoboComp DSR JSON, AGM model XML, or graph JSON: whichever it looks like.
pub fn world(bytes: &[u8]) {
    if let Ok(world) = dsr::interchange::read(&text(bytes), &dsr::Schema::open()) {
        commit(&world.transaction());
    }
}

/// A transaction as it goes to the store.
pub fn transaction(bytes: &[u8]) {
    if let Ok(transaction) = dsr::wire::decode_transaction(bytes) {
        commit(&transaction);
    }
}

fn words(bytes: &[u8]) -> Vec<u64> {
    let (words, _) = bytes.as_chunks::<8>();
    words.iter().map(|word| u64::from_le_bytes(*word)).collect()
}

/// A session's desk, as the store reads it: any words, but for the one that says that it is a desk.
pub fn desk(bytes: &[u8]) {
    let mut desk = vec![u64::from_le_bytes(*b"cortexD1")];
    desk.extend(words(bytes));
    desk.resize(512, 0);
    let epoch = Epoch(desk[42]);
    if let Some(Ok((_, transaction))) = dsr::wire::decode_desk(&desk, epoch) {
        commit(&transaction);
    }
}

/// A request, and an answer to one.
pub fn request(bytes: &[u8]) {
    for transaction in dsr::wire::decode_request(bytes).unwrap_or_default() {
        commit(&transaction);
    }
    for refusal in dsr::wire::decode_answer(bytes)
        .into_iter()
        .flatten()
        .filter_map(Result::err)
    {
        assert!(!refusal.to_string().is_empty());
    }
}

/// What goes between a session and the store about leases.
pub fn lease(bytes: &[u8]) {
    drop(dsr::wire::check_lease_request(bytes));
    drop(dsr::wire::check_lease_answer(bytes));
}

/// A page of hot attributes: any words, but for the first, which says that it is one, and a number of
/// slots in use.
pub fn hot_page(bytes: &[u8]) {
    let mut page = vec![u64::from_le_bytes(*b"cortexH2"), 1];
    page.extend(words(bytes));
    page.resize(4096, 0);
    // Whose attribute the first slot is said to be, and of which epoch its newest value.
    let newest = if page[16] & 1 == 0 { 20 } else { 32 };
    let (node, attribute, epoch) = (
        NodeId(page[17]),
        AttributeId(page[19] as u16),
        Epoch(page[newest]),
    );
    if let Some(value) = dsr::wire::read_hot_page(&page, epoch, node, attribute) {
        dsr::json::value_to_json(&value);
    }
}

/// The handle of a large value: its words, and what a schema, a graph and a file make of it.
pub fn large_handle(bytes: &[u8]) {
    let mut words = words(bytes);
    words.resize(5, 0);
    let words: Vec<String> = words.iter().map(u64::to_string).collect();
    let json = serde_json::json!({"type": "large", "value": words});
    let Ok(value) = dsr::json::value_from_json(&json, None) else {
        return;
    };
    if let Some(handle) = value.as_large() {
        for kind in NumberKind::ALL
            .into_iter()
            .filter(|kind| handle.is_of(*kind))
        {
            assert!(handle.bytes().is_multiple_of(kind.size() as u64));
        }
        assert!(!handle.to_string().is_empty());
        let again = LargeHandle::new(
            handle.stream(),
            handle.sequence(),
            handle.bytes(),
            handle.shape(),
        );
        assert!(again.is_some_and(|again| again.shape() == handle.shape()));
    }
    let mut transaction = Transaction::new();
    transaction.create_node("thing", "thing", vec![("large".to_owned(), value)]);
    commit(&transaction);
}

/// A change as it goes to every agent.
pub fn change(bytes: &[u8]) {
    if let Ok(change) = dsr::wire::decode_change(bytes) {
        let everything = dsr::Filter::default();
        assert!(everything.passes(&change, &Schema::open()));
    }
}

/// A graph as it goes from a supervisor to a store; it consists of what the rows of a state folder are.
pub fn image(bytes: &[u8]) {
    if let Ok(image) = dsr::decode_image(bytes) {
        let mut graph = Graph::in_memory(Schema::open());
        if graph.restore(&image).is_ok() {
            assert!(read(&graph.snapshot()).is_ok());
        }
    }
}

/// RoboComp DSR JSON, so that the whole input is the graph.
pub fn robocomp(bytes: &[u8]) {
    world(format!("{{\"DSRModel\":{}}}", text(bytes)).as_bytes());
}

/// AGM model XML, so that the whole input is the model.
pub fn agm(bytes: &[u8]) {
    world(format!("<AGMModel>{}</AGMModel>", text(bytes)).as_bytes());
}

/// A PDDL domain and, after a byte 0, a problem.
pub fn pddl(bytes: &[u8]) {
    let text = text(bytes);
    let (domain, problem) = text.split_once('\0').unwrap_or((&text, ""));
    let domain = grammar::SourceFile::new("domain.pddl", domain);
    let problem = grammar::SourceFile::new("problem.pddl", problem);
    if let Err(defects) = executive::pddl::read(&domain, &problem) {
        assert!(!defects.is_empty());
    }
}

/// An agent's manifest.
pub fn manifest(bytes: &[u8]) {
    drop(dsr::Manifest::from_toml(
        "agent.toml",
        &text(bytes),
        &Schema::open(),
    ));
}

/// Grid maps with lists of optima, and recordings of people: whichever it looks like.
pub fn recording(bytes: &[u8]) {
    let text = text(bytes);
    drop(scenarios::grid_file::parse_map("a.map", &text));
    drop(scenarios::Tracks::parse("obsmat.txt", &text));
    drop(scenarios::scenes::parse_recording(&text));
    drop(scenarios::scenes::parse_scenes(&text));
}

/// A schema file.
pub fn schema(bytes: &[u8]) {
    drop(Schema::from_toml("schema.toml", &text(bytes)));
}

/// How much is done for the conflicts of a grammar.
const CONFLICT_EFFORT: u64 = 100_000_000;

/// A grammar: parsed, checked, its defects shown, its rules compared, printed, matched, explained and applied,
/// those beside broken ones, too. Each is bounded, so that a slow or a large answer is found as such.
pub fn grammar(bytes: &[u8]) {
    let (grammar, diagnostics) = grammar::parse_grammar(&text(bytes), "rules.aggl");
    for diagnostic in &diagnostics {
        assert!(diagnostic.line_and_column().0 > 0, "lines count from 1");
    }
    let broken = grammar::has_errors(&diagnostics);
    let sound = if broken {
        grammar.sound(&diagnostics).ok()
    } else {
        None
    };
    let sound = sound.map(|sound| sound.grammar);
    show(diagnostics);
    show(grammar.analyse(None));
    for grammar in sound.iter().chain([&grammar]) {
        let conflicts = grammar.conflicts(None, CONFLICT_EFFORT);
        assert!(conflicts.found.len() <= grammar::CONFLICT_LIMIT);
        let conflicts = conflicts.found.into_iter();
        show(conflicts.map(|conflict| conflict.diagnostic).collect());
        let snapshot = left_sides(grammar).snapshot();
        for rule in grammar.all_rules().take(20) {
            match_and_apply(grammar, rule, &snapshot);
        }
    }
    if !broken {
        let (_, again) = grammar::parse_grammar(&grammar.to_string(), "rules.aggl");
        assert!(
            !grammar::has_errors(&again),
            "what was printed cannot be read"
        );
    }
}

/// Shows what is wrong as the program does.
fn show(diagnostics: Vec<grammar::Diagnostic>) {
    let all = diagnostics.len();
    let defects = grammar::Defects { diagnostics };
    let words = defects.to_string().len();
    let shown = defects.report();
    // An excerpt of each, and each one's words up to three times.
    let most = 4_000 * all.min(grammar::SHOWN_LIMIT) + 4 * words + 1_000;
    assert!(shown.len() < most, "{} bytes of {all} defects", shown.len());
}

fn match_and_apply(grammar: &grammar::Grammar, rule: &grammar::Rule, snapshot: &Snapshot) {
    let nothing = grammar::Binding::new();
    drop(grammar.search_plan_within(Some(snapshot), rule, &nothing, 50_000));
    let Ok(matches) = grammar.matches(snapshot, rule, &nothing) else {
        return;
    };
    let mut matches = matches.within(50_000).within_all(100_000);
    for binding in matches.by_ref().take(3).flatten() {
        drop(grammar.apply(snapshot, &rule.name, &binding));
        drop(grammar.obstacle(snapshot, rule, &binding));
    }
    if let Ok((count, complete)) = matches.count_rest() {
        assert!(complete || count <= 100_000);
    }
}

/// A graph in which each rule's left side is once, as far as a graph can have it, and many nodes of the types
/// in it.
fn left_sides(grammar: &grammar::Grammar) -> Graph {
    let mut graph = Graph::in_memory(Schema::open());
    for (index, rule) in grammar.rules.iter().enumerate().take(20) {
        let name = |variable: &str| format!("{variable}{index}");
        let mut transaction = Transaction::new();
        for node in rule.bound_nodes() {
            transaction.create_node(&node.type_name, &name(&node.variable), vec![]);
        }
        for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
            transaction.create_edge(name(&edge.from), &edge.label, name(&edge.to));
        }
        drop(graph.commit(&transaction, "fuzz", Time::default()));
        let mut crowd = Transaction::new();
        for node in rule.bound_nodes().take(3) {
            for one in 0..20 {
                crowd.create_node(
                    &node.type_name,
                    &format!("{one} more of {index}{}", node.variable),
                    vec![],
                );
            }
        }
        drop(graph.commit(&crowd, "fuzz", Time::default()));
    }
    graph
}

/// A goal.
pub fn goal(bytes: &[u8]) {
    drop(grammar::parse_goal(
        &text(bytes),
        "goal.aggt",
        &grammar::Types::default(),
    ));
}

/// A scenario's main file.
pub fn scenario(bytes: &[u8]) {
    let nothing = |_: &str| Ok(Vec::new());
    drop(scenarios::Scenario::parse(
        "scenario.toml",
        &text(bytes),
        &nothing,
    ));
}

/// The memory of a graph, overwritten: each eleven bytes say where (three) and with what (eight).
pub fn arena(bytes: &[u8]) {
    static WHOLE: OnceLock<Vec<u64>> = OnceLock::new();
    // Without the part that nobody has written to: filling it would take longer than all else.
    let whole = WHOLE.get_or_init(|| {
        let mut words = small_graph().words();
        let used = words.iter().rposition(|word| *word != 0);
        words.truncate(used.map_or(1, |last| last + 1));
        words
    });
    let mut words = whole.clone();
    for change in bytes.chunks_exact(11).take(64) {
        let mut eight = [0; 8];
        eight.copy_from_slice(&change[3..]);
        let place =
            usize::from(change[0]) | usize::from(change[1]) << 8 | usize::from(change[2]) << 16;
        let place = place % words.len();
        words[place] = u64::from_le_bytes(eight);
    }
    if let Ok(snapshot) = Snapshot::of_words(&words) {
        match read(&snapshot) {
            // No more is there than there is room for.
            Ok(count) => assert!(count <= 64 * words.len() as u64, "{count} things read"),
            Err(ReadError::Damaged { .. } | ReadError::SnapshotTooOld { .. }) => {}
        }
    }
}

/// A graph with something of everything in it.
pub fn small_graph() -> Graph {
    // Types that descend from others in many ways, so that damage makes more of it.
    let step = |i: u32| format!("a{i} = ['a{0}', 'b{0}']\nb{i} = ['a{0}', 'b{0}']\n", i - 1);
    let steps: String = (1..24).map(step).collect();
    let schema = format!("open = true\n[types]\nthing = []\na0 = ['thing']\nb0 = []\n{steps}");
    let schema = Schema::from_toml("small", &schema).expect("a schema");
    let mut graph = Graph::in_memory(schema);
    for i in 0..70u64 {
        let mut transaction = Transaction::new();
        let attributes = vec![
            ("n".to_owned(), i.into()),
            ("text".to_owned(), format!("{i}").repeat(9).into()),
            ("row".to_owned(), [0.5; 6].into()),
        ];
        transaction.create_node("thing", &format!("node{i}"), attributes);
        if i > 0 {
            let (parent, child) = (format!("node{}", i / 2), format!("node{i}"));
            let pose = dsr::Pose::translation(1.0, 0.0, 0.0);
            transaction.push(dsr::Operation::CreateEdge {
                edge: dsr::EdgeRef::new(parent, "pose", child),
                attributes: vec![("transform".to_owned(), dsr::Value::Pose(pose))],
            });
            transaction.create_edge(format!("node{i}"), "next", format!("node{}", i * 7 % i));
        }
        drop(graph.commit(&transaction, &format!("agent{}", i % 3), Time::default()));
    }
    graph
}

/// Reads a snapshot in every way; how many things there were.
///
/// # Errors
/// The first error that a read gave.
pub fn read(snapshot: &Snapshot) -> Result<u64, ReadError> {
    let mut count = 0;
    let schema = snapshot.schema();
    for node in snapshot.nodes() {
        let node = node?;
        count += 1 + node.attributes()?.len() as u64;
        if node.version()? > Version(u64::MAX - 1) {
            count += 1;
        }
        snapshot.find_node_by_name(&node.name()?)?;
        for key in node.out_edges().chain(node.in_edges()) {
            if let Some(edge) = snapshot.find_edge(key?)? {
                count += 1 + edge.attributes()?.len() as u64;
            }
        }
        snapshot.pose_in_world(node.id())?;
    }
    for type_id in (0..schema.types().len()).map(|id| dsr::TypeId(id as u16)) {
        for node in snapshot.nodes_of_type(type_id) {
            node?;
            count += 1;
        }
        snapshot.count_of_type(type_id)?;
    }
    for label in (0..schema.labels().len()).map(|id| dsr::LabelId(id as u16)) {
        for key in snapshot.edges_of_label(label) {
            key?;
            count += 1;
        }
        for triple in snapshot.triple_counts(label) {
            triple?;
        }
        snapshot.count_of_label(label)?;
    }
    Ok(count)
}
