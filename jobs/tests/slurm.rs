//! Scripts for Slurm: their text, and their behaviour in a shell with fake Slurm commands.

use std::num::NonZeroUsize;

use spherule_jobs::export::slurm::{ArrayScript, FrameCommand, Resources};
use spherule_jobs::export::{Chunks, ExportError};

const ARGUMENTS: [&str; 2] = ["render", "/data/it's/job.toml"];

fn chunks(frames: &[i64], size: usize) -> Chunks {
    Chunks::of(frames, NonZeroUsize::new(size), NonZeroUsize::MAX).unwrap()
}

fn script<'a>(chunks: &'a Chunks, program: &'a str) -> ArrayScript<'a> {
    ArrayScript {
        name: "dam break",
        title: "Renders frames of /data/it's/job.toml",
        command: FrameCommand {
            program,
            variable: "SPHERULE",
            arguments: &ARGUMENTS,
            limit_memory: true,
        },
        chunks,
        resources: Resources { cpus: 8, ..Resources::default() },
        signal_ahead: 120,
        log_dir: "/data/logs",
    }
}

fn directives(script: &ArrayScript) -> Vec<String> {
    let text = script.text().unwrap();
    let directive = |line: &str| Some(line.strip_prefix("#SBATCH --")?.to_owned());
    text.lines().filter_map(directive).collect()
}

/// Asserts that the script is rejected after `change` with an error that contains `what`.
#[track_caller]
fn refused(what: &str, change: impl FnOnce(&mut ArrayScript)) {
    let chunks = chunks(&[1], 1);
    let mut script = script(&chunks, "/bin/spherule");
    assert!(script.text().is_ok());
    change(&mut script);
    let error = script.text().unwrap_err().to_string();
    assert!(error.contains(what), "{error}");
}

#[test]
fn unset_resources_are_not_requested() {
    let chunks = chunks(&[1, 2, 3, 7], 3);
    assert_eq!(
        directives(&script(&chunks, "/bin/spherule")),
        [
            "job-name=dam-break",
            "array=0-1",
            "nodes=1",
            "ntasks=1",
            "cpus-per-task=8",
            "signal=B:TERM@120",
            "requeue",
            "open-mode=append",
            "output=\"/data/logs/%A_%a.log\"",
        ]
    );
}

#[test]
fn set_resources_are_requested() {
    let chunks = chunks(&[1, 2, 3, 7], 1);
    let mut script = script(&chunks, "/bin/spherule");
    script.resources = Resources {
        cpus: 2,
        // Memory is rounded up to MiB
        memory: Some((4 << 30) + 1),
        time: Some("90".parse().unwrap()),
        concurrent: Some(2),
        partition: Some("short,long"),
        account: Some("sim_42"),
    };
    script.log_dir = "/data/100% it's";
    let found = directives(&script);
    for expected in [
        "array=0-3%2",
        "cpus-per-task=2",
        "mem=4097M",
        "time=01:30:00",
        "partition=short,long",
        "account=sim_42",
        "output=\"/data/100%% it's/%A_%a.log\"",
    ] {
        assert!(found.iter().any(|d| d == expected), "{expected}: {found:?}");
    }
}

#[test]
fn texts_that_could_become_another_line_or_option_are_rejected() {
    refused("line break", |s| s.title = "a\n#SBATCH --mem=0");
    refused("log directory", |s| s.log_dir = "/a\"b");
    refused("backslash", |s| s.log_dir = "/a\\b");
    refused("program", |s| s.command.program = "/a\nb");
    refused("argument", |s| s.command.arguments = &["a\rb"]);
    refused("partition: \"a b\" is not a valid Slurm name", |s| {
        s.resources.partition = Some("a b");
    });
    refused("account", |s| s.resources.account = Some(""));
    refused("1 to 65535", |s| s.signal_ahead = 0);
    refused("a time limit of 00:02:00 leaves no time", |s| {
        s.resources.time = Some("2:00".parse().unwrap());
    });
    let error = Chunks::of(&[], None, NonZeroUsize::MIN).unwrap_err();
    assert_eq!(error, ExportError::NoFrames);
}

#[test]
fn job_names_have_only_plain_characters() {
    let chunks = chunks(&[1], 1);
    for (name, shown) in
        [("größe 7", "gr--e-7"), ("--", "frames"), ("a,b;c", "a-b-c"), ("", "frames")]
    {
        let mut script = script(&chunks, "/bin/spherule");
        script.name = name;
        assert_eq!(directives(&script)[0], format!("job-name={shown}"));
    }
}

#[cfg(unix)]
mod run {
    use super::*;
    use proptest::prelude::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::os::unix::process::ExitStatusExt;
    use std::path::PathBuf;
    use std::process::{Child, Command, Stdio};
    use std::thread;
    use std::time::Duration;

    /// A directory with a script, a fake `squeue` and `scontrol`, and a fake program.
    struct FakeCluster {
        dir: tempfile::TempDir,
        script: PathBuf,
    }

    /// Prints its arguments, and stops on TERM like a program that finishes its frame.
    const PROGRAM: &str = r#"#!/bin/sh
printf '%s\n' "$@" > called
trap 'echo term >> terms; stop=1' TERM
echo > ready
while [ -z "$stop" ] && [ -z "$CODE" ]; do sleep 0.02; done
exit "${CODE:-75}"
"#;

    impl FakeCluster {
        fn new(frames: &[i64], size: usize) -> Self {
            let dir = tempfile::tempdir().unwrap();
            let chunks = chunks(frames, size);
            let program = dir.path().join("pro gram's");
            let text = script(&chunks, program.to_str().unwrap()).text().unwrap();
            let cluster = Self { script: dir.path().join("array.sh"), dir };
            fs::write(&cluster.script, text).unwrap();
            cluster.write_script("pro gram's", PROGRAM);
            cluster.write_script("bin/squeue", "#!/bin/sh\necho \"$STATE\"\n");
            cluster.write_script("bin/scontrol", "#!/bin/sh\necho \"$@\" >> scontrol\n");
            cluster
        }

        fn path(&self, name: &str) -> PathBuf {
            self.dir.path().join(name)
        }

        fn write_script(&self, name: &str, text: &str) {
            let path = self.path(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        }

        /// Starts task `task` of array 40, whose state in the queue is `state`.
        fn start(&self, task: usize, state: &str, more: &[(&str, &str)]) -> Child {
            let path = std::env::var("PATH").unwrap();
            Command::new("bash")
                .arg(&self.script)
                .current_dir(&self.dir)
                .env_clear()
                .env("PATH", format!("{}:{path}", self.path("bin").display()))
                .env("SLURM_ARRAY_JOB_ID", "40")
                .env("SLURM_JOB_ID", "41")
                .env("SLURM_ARRAY_TASK_ID", task.to_string())
                .env("SLURM_CPUS_PER_TASK", "3")
                .env("STATE", state)
                .envs(more.iter().copied())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap()
        }

        fn output(&self, name: &str) -> String {
            fs::read_to_string(self.path(name)).unwrap_or_default()
        }

        /// Starts a task and sends TERM once the program handles it. Returns the exit code.
        fn stopped(&self, state: &str, more: &[(&str, &str)]) -> Option<i32> {
            let _ = fs::remove_file(self.path("ready"));
            let mut task = self.start(0, state, more);
            while !self.path("ready").exists() {
                assert!(task.try_wait().unwrap().is_none(), "it is over");
                thread::sleep(Duration::from_millis(5));
            }
            signal(&task);
            code(task)
        }
    }

    fn signal(task: &Child) {
        let id = task.id().to_string();
        let sent = Command::new("kill").args(["-TERM", &id]).status();
        assert!(sent.unwrap().success());
    }

    fn code(mut task: Child) -> Option<i32> {
        let status = task.wait().unwrap();
        assert_eq!(status.signal(), None);
        status.code()
    }

    #[test]
    fn each_task_processes_its_frames() {
        let cluster = FakeCluster::new(&[-5, -4, -2, 1, 3, 5, 9], 3);
        for (task, frames) in ["-5--4,-2", "1-5x2", "9"].into_iter().enumerate() {
            let ran = cluster.start(task, "", &[("CODE", "0")]);
            assert_eq!(code(ran), Some(0));
            assert_eq!(
                cluster.output("called"),
                format!("render\n/data/it's/job.toml\n--frames\n{frames}\n--threads\n3\n")
            );
        }
        assert_eq!(code(cluster.start(3, "", &[])), Some(2));
        let ran = cluster.start(0, "", &[("CODE", "0"), ("SLURM_MEM_PER_NODE", "4000")]);
        assert_eq!(code(ran), Some(0));
        assert!(cluster.output("called").ends_with("--memory-limit\n3600MiB\n"));
    }

    #[test]
    fn the_program_can_be_overridden() {
        let cluster = FakeCluster::new(&[1], 1);
        let other = "#!/bin/sh\necho other > called\n";
        cluster.write_script("bin/other", other);
        assert_eq!(code(cluster.start(0, "", &[("SPHERULE", "other")])), Some(0));
        assert_eq!(cluster.output("called"), "other\n");
    }

    #[test]
    fn exit_codes_are_forwarded_and_only_75_requeues_the_task() {
        let cluster = FakeCluster::new(&[1], 1);
        for failed in ["0", "1", "2", "137"] {
            let ran = cluster.start(0, "RUNNING None", &[("CODE", failed)]);
            assert_eq!(code(ran), failed.parse().ok());
            assert_eq!(cluster.output("scontrol"), "", "{failed}");
        }
        let ran = cluster.start(0, "RUNNING None", &[("CODE", "75")]);
        assert_eq!(code(ran), Some(75));
        assert_eq!(cluster.output("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn term_is_forwarded_and_the_task_requeued() {
        let cluster = FakeCluster::new(&[1], 1);
        assert_eq!(cluster.stopped("RUNNING None", &[]), Some(75));
        assert_eq!(cluster.output("terms"), "term\n");
        assert_eq!(cluster.output("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn a_program_without_a_signal_handler_yet_is_requeued_too() {
        let cluster = FakeCluster::new(&[1], 1);
        let deaf = "#!/bin/sh\necho > ready\nwhile :; do sleep 0.02; done\n";
        cluster.write_script("pro gram's", deaf);
        assert_eq!(cluster.stopped("RUNNING None", &[]), Some(143));
        assert_eq!(cluster.output("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn a_frame_longer_than_the_notice_requeues_the_task_too() {
        let cluster = FakeCluster::new(&[1], 1);
        assert_eq!(cluster.stopped("COMPLETING TimeLimit", &[]), Some(75));
        assert_eq!(cluster.output("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn a_cancelled_task_is_not_requeued() {
        let cluster = FakeCluster::new(&[1], 1);
        assert_eq!(cluster.stopped("COMPLETING None", &[]), Some(75));
        assert_eq!(cluster.output("scontrol"), "");
    }

    #[test]
    fn the_number_of_restarts_is_limited() {
        let cluster = FakeCluster::new(&[1, 2], 2);
        let at_limit = [("SLURM_RESTART_COUNT", "22")];
        assert_eq!(cluster.stopped("RUNNING None", &at_limit), Some(75));
        assert_eq!(cluster.output("scontrol"), "");
        let below = [("SLURM_RESTART_COUNT", "21")];
        assert_eq!(cluster.stopped("RUNNING None", &below), Some(75));
        assert_eq!(cluster.output("scontrol"), "requeue 40_0\n");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// The shell reads quoted words unchanged.
        #[test]
        fn the_shell_reads_words_unchanged(text in "[ -~äß€]{0,30}") {
            let chunks = chunks(&[1], 1);
            let arguments = ["[%s]", text.as_str()];
            let mut script = script(&chunks, "printf");
            script.command.arguments = &arguments;
            let output = Command::new("bash")
                .args(["-c", &script.text().unwrap()])
                .envs([("SLURM_ARRAY_JOB_ID", "40"), ("SLURM_ARRAY_TASK_ID", "0")])
                .env_remove("SPHERULE")
                .output()
                .unwrap();
            let printed = String::from_utf8(output.stdout).unwrap();
            let expected = format!("[{text}][--frames][1][--threads][1]");
            prop_assert_eq!(printed.lines().last(), Some(expected.as_str()));
        }
    }

    #[test]
    fn outside_an_array_the_script_names_the_remedy() {
        let cluster = FakeCluster::new(&[1], 1);
        let alone = Command::new("bash")
            .arg(&cluster.script)
            .current_dir(&cluster.dir)
            .env_remove("SLURM_ARRAY_TASK_ID")
            .output()
            .unwrap();
        assert_eq!(alone.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&alone.stderr).contains("sbatch"));
        assert!(!cluster.path("called").exists());
    }
}
