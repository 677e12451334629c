//! The command line: every verb with its flags. Parsing a flag does nothing but parse it.

mod bench;
mod graph;
mod inspect;
mod mission;
mod path;
mod recording;
mod shell;
mod social;

pub(crate) use bench::{Bench, BenchAction, BenchPeer};
pub(crate) use graph::{ExportFormat, Graph, GraphAction, GraphSource, Watch};
pub(crate) use inspect::Inspect;
pub(crate) use mission::{Mission, MissionAction, SubmitMission, Why};
pub(crate) use path::{CostModel, Path, PathAlgorithm};
pub(crate) use recording::{Record, Replay};
pub(crate) use shell::{Completions, Man, New, NewThing};
pub(crate) use social::{Experiment, RosMode, Social, SocialAction, SocialPicture};

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// A runtime in which the agents of a robot share one world model.
#[derive(Debug, Parser)]
#[command(name = "cortex", version, about, propagate_version = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Run a scenario: a store, a world and the agents, each a process; then report
    #[command(
        after_help = "Example:\n  cortex run scenarios/care-centre --speed 5 --report report"
    )]
    Run(Run),
    /// Run one agent of an instance by hand
    #[command(after_help = "Example:\n  cortex agent human_observer --instance default")]
    Agent(Agent),
    /// Run the store of an instance by hand
    #[command(
        after_help = "Example:\n  cortex store --scenario scenarios/care-centre --instance mine"
    )]
    Store(Store),
    /// Look at and change the shared graph of a running instance, or a graph file
    #[command(after_help = "Example:\n  cortex graph show --instance default")]
    Graph(Graph),
    /// Check, list, format and try the rules of a grammar file (.aggl)
    #[command(after_help = "Example:\n  cortex rules check scenarios/care-centre/rules.aggl")]
    Rules(Rules),
    /// Find the steps that lead from a world to a goal
    #[command(
        after_help = "Without --optimal and --time-limit it prints the first plan it finds.\n\n\
        Examples:\n  cortex plan rules.aggl world.json goal.aggt --optimal\n  \
        cortex plan --instance care goal.aggt\n  cortex plan --pddl domain.pddl problem.pddl --plan-file plan"
    )]
    Plan(Plan),
    /// Submit, list, show, pause, resume and cancel the missions of a running instance
    #[command(
        after_help = "Example:\n  cortex mission submit fetch.aggt --priority 2 --deadline 120"
    )]
    Mission(Mission),
    /// Tell what brought something about: a step, a mission's plans, or an attribute's value
    #[command(
        after_help = "WHAT is the name of a mission or a step, or a path as for `cortex graph get`. \
        Without it: all missions.\n\nExamples:\n  cortex why invite\n  cortex why invite/1/0\n  \
        cortex why 'robot-in->corridor'\n  cortex why ana.position"
    )]
    Why(Why),
    /// Look at a running instance or a recording: in a browser, or in this terminal
    #[command(
        after_help = "Examples:\n  cortex inspect --web\n  cortex inspect --web 127.0.0.1:8000 --allow-edit\n  \
        cortex inspect --web --file run.mcap\n  cortex inspect --tui"
    )]
    Inspect(Inspect),
    /// Record a running instance into an MCAP file
    #[command(after_help = "Ends with the instance, or when it is interrupted.\n\n\
        Example:\n  cortex record run.mcap --instance default")]
    Record(Record),
    /// Play a recording again and tell whether the same graph comes of it; 1 where not
    #[command(
        after_help = "Without --instance, --speed and --keep it is played in memory, as fast as the machine can.\n\n\
        Examples:\n  cortex replay run.mcap\n  cortex replay run.mcap --instance past --speed 5 --keep"
    )]
    Replay(Replay),
    /// Measure how fast it is here
    #[command(after_help = "Example:\n  cortex bench graph --json")]
    Bench(Bench),
    /// Find the cheapest path over a grid map, or check a list of known ones
    #[command(
        after_help = "Cells are X,Y from the upper left; costs and lengths are in cells.\n\n\
        Examples:\n  cortex path --map arena.map --scen arena.map.scen\n  \
        cortex path --grid house.wmap --model length_mean --from 80,197 --to 10,201"
    )]
    Path(Path),
    #[command(hide = true)]
    BenchPeer(BenchPeer),
    /// People and the space they need: groups, how little a place suits a robot
    #[command(after_help = "Example:\n  cortex social groups recording.json --json")]
    Social(Social),
    /// Tell where an object is, or may be
    #[command(
        after_help = "Ends with 1 where the object is known and nobody knows where it is.\n\n\
        Example:\n  cortex where mug --instance default --json"
    )]
    Where(Where),
    /// Do the papers' tables and figures again, ours beside what is printed
    #[command(
        after_help = "Examples:\n  cortex experiment list\n  cortex experiment fd-table1 --json"
    )]
    Experiment(Experiment),
    /// Tell what on this host keeps instances from running well, and what to do about it
    #[command(after_help = "Example:\n  cortex doctor --mend")]
    Doctor(Doctor),
    /// Begin an agent or a scenario of one's own
    #[command(after_help = "Examples:\n  cortex new agent polite\n  cortex new scenario flat")]
    New(New),
    /// Print what makes a shell complete `cortex` verbs and flags
    #[command(
        after_help = "Example:\n  cortex completions bash > ~/.local/share/bash-completion/completions/cortex"
    )]
    Completions(Completions),
    /// Write manual pages
    #[command(after_help = "Example:\n  cortex man ~/.local/share/man/man1")]
    Man(Man),
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Where {
    /// Name of an object or person, or a class such as `mug`
    pub(crate) name: String,
    #[command(flatten)]
    pub(crate) source: GraphSource,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Doctor {
    /// Remove what is left of instances of which no process runs, and close what others can open
    #[arg(long)]
    pub(crate) mend: bool,
    /// For machines
    #[arg(long)]
    pub(crate) json: bool,
}

/// Which running system.
#[derive(Debug, Clone, Args)]
pub(crate) struct InstanceArgs {
    /// Name of the running system on this host
    #[arg(long, value_name = "I", default_value = "default")]
    pub(crate) instance: String,
}

#[derive(Debug, Clone, Args)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
pub(crate) struct Run {
    /// Folder of the scenario
    pub(crate) scenario: PathBuf,
    /// Without social behaviour: people are obstacles like any other
    #[arg(long)]
    pub(crate) no_social: bool,
    /// Without the comparison run that shows what social behaviour changed
    #[arg(long)]
    pub(crate) no_baseline: bool,
    /// Seed of everything that is random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Simulated seconds per second
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed)]
    pub(crate) speed: f64,
    /// One process after the other, as fast as the machine can: the same seed gives the same
    /// report, byte for byte
    #[arg(long)]
    pub(crate) lockstep: bool,
    /// Recorded pedestrians instead of the scenario's people
    #[arg(long, value_name = "FILE")]
    pub(crate) tracks: Option<PathBuf>,
    /// Keep the graph in this folder, and go on from what an earlier run left there
    #[arg(long, value_name = "DIR")]
    pub(crate) state: Option<PathBuf>,
    /// Acknowledge every commit only once it is on disk
    #[arg(long, requires = "state")]
    pub(crate) durable: bool,
    /// Record the run into this MCAP file
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// Show the run in a browser, at this address [default: 127.0.0.1:7710]
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = inspect::ADDRESS)]
    pub(crate) inspect: Option<std::net::SocketAddr>,
    /// Folder for report.json, the map and the logs [default: reports/SCENARIO]
    #[arg(long, value_name = "DIR")]
    pub(crate) report: Option<PathBuf>,
    /// Print the report as JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) instance: InstanceArgs,
}

pub(crate) fn speed(text: &str) -> Result<f64, String> {
    let speed: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if speed.is_finite() && (0.01..=1000.0).contains(&speed) {
        Ok(speed)
    } else {
        Err("the speed must lie between 0.01 and 1000".to_owned())
    }
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Agent {
    /// `human_observer`, `object_recognition`, `social_mapping`, `navigation`, `executive` or `world`
    pub(crate) name: String,
    /// Folder of the scenario; executive and world need it
    #[arg(long, value_name = "DIR")]
    pub(crate) scenario: Option<PathBuf>,
    /// world: seed of everything that is random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// world: simulated seconds per second
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed)]
    pub(crate) speed: f64,
    /// world: recorded pedestrians instead of the scenario's people
    #[arg(long, value_name = "FILE")]
    pub(crate) tracks: Option<PathBuf>,
    /// Take turns as a supervisor on standard input gives them
    #[arg(long)]
    pub(crate) lockstep: bool,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub(crate) supervised: bool,
    #[command(flatten)]
    pub(crate) instance: InstanceArgs,
}

#[derive(Debug, Clone, Args)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
pub(crate) struct Store {
    /// Folder of the scenario that the graph starts from
    #[arg(long, value_name = "DIR")]
    pub(crate) scenario: PathBuf,
    /// Keep the graph in this folder, and go on from what an earlier store left there
    #[arg(long, value_name = "DIR")]
    pub(crate) state: Option<PathBuf>,
    /// Acknowledge every commit only once it is on disk
    #[arg(long, requires = "state")]
    pub(crate) durable: bool,
    /// Begin anew, also where a store that was killed left its graph in memory
    #[arg(long)]
    pub(crate) fresh: bool,
    /// Tell the agents to do without social behaviour
    #[arg(long)]
    pub(crate) no_social: bool,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub(crate) supervised: bool,
    #[command(flatten)]
    pub(crate) instance: InstanceArgs,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Rules {
    #[command(subcommand)]
    pub(crate) action: RulesAction,
    /// For machines
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Subcommand)]
pub(crate) enum RulesAction {
    /// Tell everything that is wrong with a grammar and its includes, and where
    #[command(after_help = "Example:\n  cortex rules check scenarios/care-centre/rules.aggl")]
    Check {
        /// A grammar (.aggl), or a goal (.aggt)
        file: PathBuf,
        /// Also what does not fit this schema (TOML)
        #[arg(long, value_name = "S")]
        schema: Option<PathBuf>,
        /// Also rules that nothing can make applicable from this world: graph JSON, RoboComp DSR
        /// JSON or AGM model XML
        #[arg(long, value_name = "W")]
        world: Option<PathBuf>,
        /// Also what an agent's rules do that its manifest (TOML) does not give; may be repeated
        #[arg(long, value_name = "M")]
        manifest: Vec<PathBuf>,
        /// Also which rules can disable each other, with the smallest graphs where they do
        #[arg(long)]
        conflicts: bool,
    },
    /// List types and rules, also those of a file in which others are broken
    #[command(after_help = "Example:\n  cortex rules list scenarios/care-centre/rules.aggl --json")]
    List {
        /// A grammar (.aggl)
        file: PathBuf,
    },
    /// Print a grammar in canonical form
    #[command(after_help = "Example:\n  cortex rules fmt rules.aggl > tidy.aggl")]
    Fmt {
        /// A grammar (.aggl)
        file: PathBuf,
    },
    /// Find where the left-hand side of rules holds in a world
    #[command(
        after_help = "Example:\n  cortex rules match rules.aggl --rule changeRoom --world world.json"
    )]
    Match {
        /// A grammar (.aggl)
        file: PathBuf,
        /// Only this rule [default: every rule]
        #[arg(long, value_name = "R")]
        rule: Option<String>,
        #[command(flatten)]
        world: WorldArgs,
        /// Count the matches without listing them
        #[arg(long)]
        count: bool,
        /// List no more than so many matches of a rule; all are counted
        #[arg(
            long,
            value_name = "N",
            default_value_t = 10_000,
            conflicts_with = "count"
        )]
        limit: usize,
    },
    /// Show in which order a rule's nodes are searched for, and what each step comes to
    #[command(
        after_help = "Example:\n  cortex rules explain rules.aggl --rule changeRoom --world world.json"
    )]
    Explain {
        /// A grammar (.aggl)
        file: PathBuf,
        /// Only this rule [default: every rule]
        #[arg(long, value_name = "R")]
        rule: Option<String>,
        /// A world to search: graph JSON, RoboComp DSR JSON or AGM model XML [default: none, with
        /// assumed counts]
        #[arg(long, value_name = "W")]
        world: Option<PathBuf>,
    },
    /// Show what applying a rule to a world would change, or apply it to a running system
    #[command(
        after_help = "A file stays as it is; a running system changes unless --dry-run is given.\n\n\
        Examples:\n  cortex rules apply rules.aggl --rule changeRoom \
        --world world.json --bind room2=kitchen\n  \
        cortex rules apply rules.aggl --rule changeRoom --instance care --bind room2=kitchen"
    )]
    Apply {
        /// A grammar (.aggl)
        file: PathBuf,
        /// The rule
        #[arg(long, value_name = "R")]
        rule: String,
        #[command(flatten)]
        world: WorldArgs,
        /// Only show what would change in the running system
        #[arg(long, requires = "instance")]
        dry_run: bool,
        /// The node, by name or id, that a variable of the rule stands for; as many as it takes to
        /// leave one match
        #[arg(long, value_name = "VAR=NODE", num_args = 1.., value_parser = binding)]
        bind: Vec<(String, String)>,
    },
    /// Draw rules: the left side, the right side, and what keeps, makes and takes away
    #[command(after_help = "Example:\n  \
        cortex rules export rules.aggl --dot --rule changeRoom | dot -Tsvg > changeRoom.svg")]
    Export {
        /// A grammar (.aggl)
        file: PathBuf,
        /// As Graphviz DOT
        #[arg(long, required = true)]
        dot: bool,
        /// Only this rule [default: every rule]
        #[arg(long, value_name = "R")]
        rule: Option<String>,
    },
    /// Make a running system go by a grammar; one with anything wrong in it is refused whole
    #[command(after_help = "Example:\n  cortex rules load rules.aggl --instance care")]
    Load {
        /// A grammar (.aggl)
        file: PathBuf,
        #[command(flatten)]
        instance: InstanceArgs,
    },
}

/// Which world to look at.
#[derive(Debug, Clone, Args)]
pub(crate) struct WorldArgs {
    /// A world: graph JSON, RoboComp DSR JSON or AGM model XML
    #[arg(long, value_name = "W", required_unless_present = "instance")]
    pub(crate) world: Option<PathBuf>,
    /// The running system of this name instead of a file
    #[arg(long, value_name = "I", conflicts_with = "world")]
    pub(crate) instance: Option<String>,
}

fn binding(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((variable, node)) if !variable.is_empty() && !node.is_empty() => {
            Ok((variable.to_owned(), node.to_owned()))
        }
        _ => Err("write VARIABLE=NODE".to_owned()),
    }
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Plan {
    /// A grammar (.aggl), a world (graph JSON, RoboComp DSR JSON or AGM model XML) and a goal
    /// (.aggt); with --instance the goal alone
    #[arg(value_name = "DOMAIN WORLD GOAL", required_unless_present = "pddl", num_args = 1..=3)]
    pub(crate) files: Vec<PathBuf>,
    /// Plan by the rules and from the graph of the running system of this name, and change nothing
    #[arg(long, value_name = "I", conflicts_with = "pddl")]
    pub(crate) instance: Option<String>,
    /// Plan for a domain and a problem in PDDL instead
    #[arg(
        long,
        num_args = 2,
        value_names = ["DOMAIN", "PROBLEM"],
        conflicts_with_all = ["files", "write_pddl"]
    )]
    pub(crate) pddl: Option<Vec<PathBuf>>,
    /// A plan of least cost, or the proof that there is none
    #[arg(long)]
    pub(crate) optimal: bool,
    /// Stop after so many seconds; without --optimal, look for better plans until then
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) time_limit: Option<f64>,
    /// Stop before the search takes more memory than this
    #[arg(long, value_name = "MB", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) memory_limit: u32,
    /// How often each rule that creates nodes may be used
    #[arg(long, value_name = "N", default_value_t = 3, conflicts_with = "pddl")]
    pub(crate) spares: u16,
    /// Write domain.pddl and problem.pddl into this folder, for other planners
    #[arg(long, value_name = "DIR")]
    pub(crate) write_pddl: Option<PathBuf>,
    /// Write the plan as the planning competitions do, for validators
    #[arg(long = "plan-file", value_name = "F")]
    pub(crate) output: Option<PathBuf>,
    /// For machines
    #[arg(long)]
    pub(crate) json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if seconds.is_finite() && seconds > 0.0 {
        Ok(seconds)
    } else {
        Err("the time must be more than 0 seconds".to_owned())
    }
}
