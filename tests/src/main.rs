//! The `cortex` program as the tests run it.
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    cortex::main()
}
