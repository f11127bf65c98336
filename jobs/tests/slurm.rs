//! Scripts for Slurm: what is in them, and what they do under a shell with a Slurm that is played.

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
        resources: Resources {
            cpus: 8,
            ..Resources::default()
        },
        signal_ahead: 120,
        log_dir: "/data/logs",
    }
}

fn directives(script: &ArrayScript) -> Vec<String> {
    let text = script.text().unwrap();
    let directive = |line: &str| Some(line.strip_prefix("#SBATCH --")?.to_owned());
    text.lines().filter_map(directive).collect()
}

/// Fails the test unless there is no script after `change`, because of `what`.
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
fn what_is_not_said_is_left_to_the_cluster() {
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
fn what_is_said_is_asked_for() {
    let chunks = chunks(&[1, 2, 3, 7], 1);
    let mut script = script(&chunks, "/bin/spherule");
    script.resources = Resources {
        cpus: 2,
        // A MiB that is begun is asked for.
        memory: Some((4 << 30) + 1),
        time: Some("90".parse().unwrap()),
        concurrent: Some(2),
        partition: Some("short,long"),
        account: Some("sim_42"),
    };
    script.log_dir = "/data/100% it's";
    let found = directives(&script);
    for wanted in [
        "array=0-3%2",
        "cpus-per-task=2",
        "mem=4097M",
        "time=01:30:00",
        "partition=short,long",
        "account=sim_42",
        "output=\"/data/100%% it's/%A_%a.log\"",
    ] {
        assert!(found.iter().any(|d| d == wanted), "{wanted}: {found:?}");
    }
}

#[test]
fn what_could_become_another_line_or_option_is_refused() {
    refused("line break", |s| s.title = "a\n#SBATCH --mem=0");
    refused("log directory", |s| s.log_dir = "/a\"b");
    refused("backslash", |s| s.log_dir = "/a\\b");
    refused("program", |s| s.command.program = "/a\nb");
    refused("argument", |s| s.command.arguments = &["a\rb"]);
    refused("partition: \"a b\" is not a name", |s| {
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
fn names_are_what_slurm_can_show() {
    let chunks = chunks(&[1], 1);
    for (name, shown) in [
        ("größe 7", "gr--e-7"),
        ("--", "frames"),
        ("a,b;c", "a-b-c"),
        ("", "frames"),
    ] {
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

    /// A place where the script runs, with a `squeue`, a `scontrol` and a program that are played.
    struct Stage {
        dir: tempfile::TempDir,
        script: PathBuf,
    }

    /// Tells what it was called with, and stops on TERM as if with a frame in hand.
    const PROGRAM: &str = r#"#!/bin/sh
printf '%s\n' "$@" > called
trap 'echo term >> terms; stop=1' TERM
echo > ready
while [ -z "$stop" ] && [ -z "$CODE" ]; do sleep 0.02; done
exit "${CODE:-75}"
"#;

    impl Stage {
        fn new(frames: &[i64], size: usize) -> Self {
            let dir = tempfile::tempdir().unwrap();
            let chunks = chunks(frames, size);
            let program = dir.path().join("pro gram's");
            let text = script(&chunks, program.to_str().unwrap()).text().unwrap();
            let stage = Self {
                script: dir.path().join("array.sh"),
                dir,
            };
            fs::write(&stage.script, text).unwrap();
            stage.play("pro gram's", PROGRAM);
            stage.play("bin/squeue", "#!/bin/sh\necho \"$STATE\"\n");
            stage.play("bin/scontrol", "#!/bin/sh\necho \"$@\" >> scontrol\n");
            stage
        }

        fn path(&self, name: &str) -> PathBuf {
            self.dir.path().join(name)
        }

        fn play(&self, name: &str, text: &str) {
            let path = self.path(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        }

        /// Task `task` of array 40, in the queue as `state`.
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

        fn said(&self, name: &str) -> String {
            fs::read_to_string(self.path(name)).unwrap_or_default()
        }

        /// Starts a task, sends TERM to the script once the program listens; the exit code.
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
    fn each_task_does_its_frames() {
        let stage = Stage::new(&[-5, -4, -2, 1, 3, 5, 9], 3);
        for (task, frames) in ["-5--4,-2", "1-5x2", "9"].into_iter().enumerate() {
            let ran = stage.start(task, "", &[("CODE", "0")]);
            assert_eq!(code(ran), Some(0));
            assert_eq!(
                stage.said("called"),
                format!("render\n/data/it's/job.toml\n--frames\n{frames}\n--threads\n3\n")
            );
        }
        assert_eq!(code(stage.start(3, "", &[])), Some(2));
        let ran = stage.start(0, "", &[("CODE", "0"), ("SLURM_MEM_PER_NODE", "4000")]);
        assert_eq!(code(ran), Some(0));
        assert!(stage.said("called").ends_with("--memory-limit\n3600MiB\n"));
    }

    #[test]
    fn another_program_can_be_named() {
        let stage = Stage::new(&[1], 1);
        let other = "#!/bin/sh\necho other > called\n";
        stage.play("bin/other", other);
        assert_eq!(code(stage.start(0, "", &[("SPHERULE", "other")])), Some(0));
        assert_eq!(stage.said("called"), "other\n");
    }

    #[test]
    fn codes_are_passed_on_and_only_75_puts_a_task_back() {
        let stage = Stage::new(&[1], 1);
        for failed in ["0", "1", "2", "137"] {
            let ran = stage.start(0, "RUNNING None", &[("CODE", failed)]);
            assert_eq!(code(ran), failed.parse().ok());
            assert_eq!(stage.said("scontrol"), "", "{failed}");
        }
        let ran = stage.start(0, "RUNNING None", &[("CODE", "75")]);
        assert_eq!(code(ran), Some(75));
        assert_eq!(stage.said("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn term_is_passed_on_and_the_task_put_back() {
        let stage = Stage::new(&[1], 1);
        assert_eq!(stage.stopped("RUNNING None", &[]), Some(75));
        assert_eq!(stage.said("terms"), "term\n");
        assert_eq!(stage.said("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn a_program_that_does_not_listen_yet_is_put_back_too() {
        let stage = Stage::new(&[1], 1);
        let deaf = "#!/bin/sh\necho > ready\nwhile :; do sleep 0.02; done\n";
        stage.play("pro gram's", deaf);
        assert_eq!(stage.stopped("RUNNING None", &[]), Some(143));
        assert_eq!(stage.said("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn a_frame_longer_than_the_notice_puts_the_task_back_too() {
        let stage = Stage::new(&[1], 1);
        assert_eq!(stage.stopped("COMPLETING TimeLimit", &[]), Some(75));
        assert_eq!(stage.said("scontrol"), "requeue 40_0\n");
    }

    #[test]
    fn a_cancelled_task_is_not_put_back() {
        let stage = Stage::new(&[1], 1);
        assert_eq!(stage.stopped("COMPLETING None", &[]), Some(75));
        assert_eq!(stage.said("scontrol"), "");
    }

    #[test]
    fn a_task_is_not_put_back_for_ever() {
        let stage = Stage::new(&[1, 2], 2);
        let often = [("SLURM_RESTART_COUNT", "22")];
        assert_eq!(stage.stopped("RUNNING None", &often), Some(75));
        assert_eq!(stage.said("scontrol"), "");
        let less = [("SLURM_RESTART_COUNT", "21")];
        assert_eq!(stage.stopped("RUNNING None", &less), Some(75));
        assert_eq!(stage.said("scontrol"), "requeue 40_0\n");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Whatever a path has in it, the shell takes for nothing else.
        #[test]
        fn words_come_back_from_the_shell(text in "[ -~äß€]{0,30}") {
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
            let told = String::from_utf8(output.stdout).unwrap();
            let wanted = format!("[{text}][--frames][1][--threads][1]");
            prop_assert_eq!(told.lines().last(), Some(wanted.as_str()));
        }
    }

    #[test]
    fn outside_an_array_it_says_what_to_do() {
        let stage = Stage::new(&[1], 1);
        let alone = Command::new("bash")
            .arg(&stage.script)
            .current_dir(&stage.dir)
            .env_remove("SLURM_ARRAY_TASK_ID")
            .output()
            .unwrap();
        assert_eq!(alone.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&alone.stderr).contains("sbatch"));
        assert!(!stage.path("called").exists());
    }
}
