//! That hints name the right option or key.

use clap::{CommandFactory, Parser};

use super::*;
use crate::cli::Cli;
use crate::cli::guesses::GUESSES;

fn message(line: &str) -> String {
    let arguments: Vec<&str> = line.split_whitespace().collect();
    let error = Cli::try_parse_from(&arguments).expect_err("a wrong option");
    with_hints(error, arguments[1], &Cli::command()).to_string()
}

#[test]
fn hints_name_what_the_command_has() {
    for (line, expected) in [
        ("spherule still a -o b.png --filter box", "'--set image.filter=VALUE'"),
        ("spherule still a -o b.png --camera-f-stop 3", "'--set camera.f_stop=VALUE'"),
        ("spherule render a --widht 3", "'--width'"),
        (
            "spherule still a -o b.png --isolate",
            "--isolate: is for jobs, and `spherule still` has none",
        ),
    ] {
        let text = message(line);
        assert!(text.contains(expected), "{line}: {text}");
    }
}

#[test]
fn useless_hints_are_left_out() {
    for (line, useless) in [
        ("spherule still a -o b.png --filter box", "--idle"),
        ("spherule still a -o b.png --randomness 1", "--legend"),
        ("spherule still a -o b.png --untangle", "-- --untangle"),
        ("spherule convert a -o b --max-eror -1", "-- -"),
    ] {
        let text = message(line);
        assert!(!text.contains(useless), "{line}: {text}");
    }
}

/// Options that users of other programs guess, and the option or key that is right. Those without one are real
/// options, or have nothing that stands for them.
const GUESSED: &[(&str, &str)] = &[
    // Real options
    ("--seed 3", ""),
    ("--title Speed", ""),
    ("--ortho", ""),
    ("--size 640x480", ""),
    ("--cmap turbo", ""),
    ("--colormap turbo", ""),
    ("--slice z=0.5:0.1", ""),
    ("--clip x<0.5", ""),
    ("--background white", ""),
    ("--transparent", ""),
    ("--axes", ""),
    ("--scale-bar", ""),
    ("--text a", ""),
    ("--arrows velocity:1", ""),
    ("--trails 10", ""),
    ("--opacity 0.5", ""),
    ("--fov 30", ""),
    ("--eye 1,2,3 --look-at 0,0,0", ""),
    ("--azimuth 30", ""),
    ("--elevation 30", ""),
    ("--legend", ""),
    ("--vmin 0 --vmax 1", ""),
    ("--color red", ""),
    ("--colour-by speed", ""),
    ("--unit m/s", ""),
    ("--timestamp", ""),
    ("--color-map jet", ""),
    ("--colorbar", ""),
    // Hints
    ("--turntable 36", ""),
    ("--zoom 2", ""),
    ("--box", "--cell"),
    ("--bbox", "--cell"),
    ("--select x", "--where"),
    ("--type 1", "--where 'type == 1'"),
    ("--resolution 640x480", "--size"),
    ("--res 640", "--size"),
    ("-s 640x480", "--size"),
    ("--figsize 4,3", "--size"),
    ("--spp 16", "--samples"),
    ("--quality high", "--samples"),
    ("--aa 4", "--samples"),
    ("--preset paper", "--look"),
    ("--fps 25", "output.fps"),
    ("--framerate 25", "output.fps"),
    ("--output-dir out", "--output"),
    ("--start 3", "--frame "),
    ("--end 3", "--frame "),
    ("--step 3", "--frame "),
    ("--timestep 3", "--frame "),
    ("--shadow", "--ground shadow_catcher"),
    ("--shadows", "--ground shadow_catcher"),
    ("--no-shadows", "--ground=none"),
    ("--ao", "render.indirect"),
    ("--ambient-occlusion", "render.indirect"),
    ("--floor", "--ground"),
    ("--no-floor", "--ground=none"),
    ("--no-ground", "--ground=none"),
    ("--bg white", "--background"),
    ("--bgcolor white", "--background"),
    ("--background-color white", "--background"),
    ("--time", "--time-stamp"),
    ("--label Speed", "--title"),
    ("--colorbar-title Speed", "--title"),
    ("--range-min 0", "--vmin"),
    ("--clim 0", "--range"),
    ("--color-range 0", "--range"),
    ("--log", "--color-scale"),
    ("--palette turbo", "--map"),
    ("--lut turbo", "--map"),
    ("--scalars speed", "--color-by"),
    ("--attribute speed", "--color-by"),
    ("--camera 1,2,3", "--eye"),
    ("--camera-position 1,2,3", "--eye"),
    ("--focal-point 1,2,3", "--look-at"),
    ("--centre 1,2,3", "--look-at"),
    ("--target 1,2,3", "--look-at"),
    ("--view-up z", "--up"),
    ("--view-angle 30", "--fov"),
    ("--rotate 30", "--azimuth"),
    ("--orthographic", "--ortho"),
    ("--parallel-projection", "--ortho"),
    ("--perspective", "--projection"),
    ("--alpha 0.5", "--opacity"),
    ("--transparency 0.5", "--opacity"),
    ("--transparent-background", "--transparent"),
    ("--point-size 3", "--radius"),
    ("--particle-radius 3", "--radius"),
    ("--vdw", "--radius vdw"),
    ("--representation cpk", "--look"),
    ("--cpk", "--bonds"),
    ("--isosurface", "--surface smooth"),
    ("--glyph velocity", "--arrows"),
    ("--quiver velocity", "--arrows"),
    ("--vectors velocity", "--arrows"),
    ("--pathlines", "--trails"),
    ("--cut x", "--clip"),
    ("--filter-by x", "--where"),
    ("--hide wall", "--parts"),
    ("--annotate a", "--text"),
    ("--caption a", "--text"),
    ("--font-size 8", "overlay"),
    ("--legend-position left", "overlay"),
    ("--triad", "--axes"),
    ("--ruler", "--scale-bar"),
    ("--exposure 1", "output.preview_exposure"),
    ("--tonemap agx", "output.view_transform"),
    ("--gamma 2", "output.preview_exposure"),
    ("--light sun", "environment.type"),
    ("--hdri a.hdr", "environment.image"),
    ("--dof 2", "camera.f_stop"),
    ("--aperture 2", "camera.aperture"),
    ("--focus 2", "camera.focus"),
    ("--motion-blur", "camera.shutter"),
    ("--stereo", "camera.stereo"),
    ("--material glass", "material.type"),
    ("--glass", "material.type"),
    ("--roughness 0.5", "material.roughness"),
    ("--ior 1.3", "material.ior"),
    ("--every 10", "select.every"),
    ("--ids 1-3", "select.ids"),
    ("--slab z", "--slice"),
    ("--repeat 2", "--replicate"),
    ("--pbc", "--wrap"),
    ("--whole", "--unwrap"),
    ("--superpose a", "--align"),
    ("--filter box", "image.filter"),
    ("--cores 2", "--threads"),
    ("-j 2", "--threads"),
    ("--memory 2G", "--memory-limit"),
    ("--config a", "needs no option: spherule still job.toml"),
    ("--input a", "files need no option: spherule still FILES"),
    ("-i a", "files need no option"),
    ("--max-bounces 3", "--bounces"),
    ("--checkerboard", "--ground"),
    ("--grid", "--ground"),
    ("--engine path", "--integrator"),
    ("--dry-run", "spherule check"),
    ("--movie a.mp4", "spherule movie"),
    // Nothing stands for these
    ("--cuda", "--device"),
    ("--fog", NOTHING),
];

/// The mark of guesses without a right answer.
const NOTHING: &str = "nothing";

#[test]
fn natural_guesses_lead_to_the_right_option() {
    let program = Cli::command();
    let mut wrong = Vec::new();
    for (options, right) in GUESSED {
        let line = format!("spherule still a -o b.png {options}");
        let parsed = Cli::try_parse_from(line.split_whitespace());
        match parsed {
            Ok(_) => assert_eq!(*right, "", "{options}: is an option"),
            Err(error) => {
                let text = with_hints(error, "still", &program).to_string();
                let tip = text.split_once("tip: ").map_or("", |(_, tip)| tip);
                if right.is_empty() || !tip.contains(right) {
                    wrong.push(format!("{options}: {text}"));
                }
            }
        }
    }
    let nothing = GUESSED.iter().filter(|(_, right)| *right == NOTHING).count();
    assert!(GUESSED.len() >= 85 && nothing <= 10);
    assert_eq!(wrong.len(), nothing, "{}", wrong.join("\n"));
}

#[test]
fn hints_name_only_what_the_command_has() {
    let program = Cli::command();
    for command in program.get_subcommands() {
        for word in GUESSES.iter().flat_map(|(words, _)| words.split_whitespace()) {
            let text = hint(&format!("--{word}"), command).unwrap_or_default();
            let options = text.split(['\'', ' ', '=']).filter_map(|part| part.strip_prefix("--"));
            for option in options {
                assert!(has_option(command, option), "{} --{word}: {text}", command.get_name());
            }
        }
    }
}

#[test]
fn every_guess_is_there_once_and_has_a_hint_somewhere() {
    let program = Cli::command();
    let mut words: Vec<&str> =
        GUESSES.iter().flat_map(|(words, _)| words.split_whitespace()).collect();
    for word in &words {
        let mut commands = program.get_subcommands();
        let has_hint = |command: &Command| hints_for(word).any(|hint| is_possible(hint, command));
        assert!(commands.any(has_hint), "{word}");
    }
    // Keys in hints are keys
    for hint in GUESSES.iter().flat_map(|(_, hints)| hints.split('|')) {
        let key = hint.strip_prefix("--set ").and_then(|set| set.split_once('='));
        if let Some((key, _)) = key
            && !key.contains(['\'', 'K'])
        {
            let section = key.strip_prefix("material.color.");
            let is_known = section.is_some() || keys_called(key).contains(&key.to_owned());
            assert!(is_known, "{hint}");
        }
    }
    let count = words.len();
    words.sort_unstable();
    words.dedup();
    assert_eq!(words.len(), count);
}
