//! The `cortex` program: see `cortex --help`.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    cortex::main()
}
