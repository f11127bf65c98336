//! Options of other programs (OVITO, ParaView, VMD, matplotlib, Blender, ffmpeg, POV-Ray), and what stands for them
//! here.

/// Words, separated by spaces, and hints for them, separated by `|`. A hint that begins with an option only counts for
/// commands that have the option; other hints count for commands with `--set`.
pub(super) const GUESSES: &[(&str, &str)] = &[
    // Image
    (
        "resolution res dimensions dims imagesize imgsize figsize geometry viewport windowsize s",
        "--size WIDTHxHEIGHT|--width PIXELS",
    ),
    (
        "spp quality aa antialias antialiasing supersampling pixelsamples samplesperpixel renderquality raysperpixel",
        "--samples N",
    ),
    ("fast lowquality lq quick hq", "--draft|--samples N"),
    ("part region tile subregion roi renderregion", "--crop X0,Y0,X1,Y1"),
    ("margin padding border", "--set image.overscan=PIXELS"),
    ("ppi pixelsperinch", "--dpi DPI"),
    // Camera
    ("orthographic parallel parallelprojection ortho2d isometric", "--ortho"),
    ("perspective panorama 360 fisheye", "--projection PROJECTION"),
    (
        "camera cam camerapos cameraposition viewpos pos position eyepos eyeposition from viewpoint",
        "--eye X,Y,Z|--view SIDE",
    ),
    (
        "target focalpoint centre lookat at camerafocus camerafocalpoint viewcenter",
        "--look-at X,Y,Z",
    ),
    ("upaxis viewup vup updirection cameraup", "--up AXIS"),
    ("rotate rotation angle yaw phi orbit heading azim rotatez", "--azimuth DEGREES|--view SIDE"),
    ("pitch theta tilt elev altitude inclination rotatex", "--elevation DEGREES|--view SIDE"),
    ("side viewdir viewdirection viewtype direction front topview", "--view SIDE"),
    ("viewangle fieldofview angleofview lens focallength", "--fov DEGREES"),
    ("zoomfactor magnification", "--zoom FACTOR"),
    ("spin revolve", "--turntable PICTURES"),
    ("dof depthoffield fnumber bokeh", "--set camera.f_stop=NUMBER"),
    ("motionblur blur shutterangle", "--set camera.shutter=0.5"),
    ("keyframes camerapath campath", "--camera-path FILE"),
    ("anaglyph sidebyside vr", "--set camera.stereo=true"),
    // Colours
    (
        "c colorattribute colorarray scalars scalar scalarfield field variable var array attribute attr property \
         coloring colorcoding colourcoding colorcode by colormode colorproperty colormethod hue",
        "--color-by ATTRIBUTE",
    ),
    ("lut palette colors colours gradient transferfunction colortable mapname", "--map NAME"),
    (
        "clim crange colorrange colourrange datarange scalarrange limits valuerange rangeminmax",
        "--range LOW HIGH",
    ),
    (
        "min max cmin cmax rangemin rangemax startvalue endvalue low high lower upper",
        "--vmin LOW --vmax HIGH",
    ),
    ("log logscale lognorm norm uselog logarithmic linear symlog", "--color-scale SCALE"),
    ("discrete categories categorical bytype", "--color-scale categorical"),
    ("percentile percentiles robust autorange", "--set material.color.range=1%-99%"),
    ("symmetric symmetricrange vcenter midpoint", "--set material.color.range=symmetric"),
    ("invert reverse reversed flip reversecolormap", "--map NAME_r"),
    ("levels bins ncolors colorsteps bands", "--set material.color.steps=N"),
    ("colorbyelement cpkcolors", "--color-by elements"),
    (
        "particlecolor spherecolor uniformcolor solidcolor fillcolor facecolor colour",
        "--color COLOR",
    ),
    // Overlays
    ("colorlegend showlegend scalarbar colormaplegend", "--colorbar"),
    ("hidelegend withoutlegend hidecolorbar hideoverlays", "--no-legend"),
    ("outside legendoutside colorbaroutside marginlegend", "--layout beside"),
    (
        "ticks nticks numticks tickvalues numberoflabels",
        "--set 'overlay=[{type=\"colorbar\",ticks=5}]'",
    ),
    (
        "tickformat labelformat numberformat colorbarformat",
        "--set 'overlay=[{type=\"colorbar\",format=\".2f\"}]'",
    ),
    (
        "label clabel cbarlabel cbartitle colorbarlabel colorbartitle legendtitle legendlabel barlabel maptitle",
        "--title TEXT",
    ),
    ("units colorbarunit unitlabel", "--unit UNIT"),
    (
        "caption annotation annotate subtitle suptitle textlabel watermark header name",
        "--text TEXT",
    ),
    ("time timelabel showtime clock timeannotation annotatetime", "--time-stamp|--frame NUMBER"),
    ("ruler scale lengthbar sizebar", "--scale-bar"),
    (
        "axis triad tripod orientationaxes coordinateaxes coordsystem coordinatetripod gizmo showaxes",
        "--axes",
    ),
    ("logo image overlayimage", "--set 'overlay=[{type=\"image\",path=\"FILE\"}]'"),
    (
        "fontsize textsize labelsize legendsize colorbarsize",
        "--set 'overlay=[{type=\"colorbar\",size=0.05}]'",
    ),
    (
        "colorbarposition legendposition legendloc colorbarlocation loc corner cbarposition",
        "--set 'overlay=[{type=\"colorbar\",corner=\"top-left\"}]'",
    ),
    (
        "colorbarorientation legendorientation orientation horizontal",
        "--set 'overlay=[{type=\"colorbar\",orientation=\"horizontal\"}]'",
    ),
    // Particles
    (
        "vectors vector glyphs glyph quiver arrow velocityvectors vectorfield hedgehog vectordisplay",
        "--arrows ATTRIBUTE:SCALE",
    ),
    (
        "trail tail tails pathlines pathline trajectories trajectorylines traces streaklines history",
        "--trails COUNT",
    ),
    ("alpha transparency translucency translucent opaque", "--opacity NUMBER|--transparent"),
    (
        "slab section crosssection sliceplane cutslice slicez",
        "--slice AXIS=VALUE:THICKNESS|--clip 'AXIS<VALUE'",
    ),
    ("cut cutplane cutaway clipping clipplane halfspace plane", "--clip 'AXIS<VALUE'"),
    (
        "select selection condition expression expr filterby only show query sel if particlefilter",
        "--where 'CONDITION'",
    ),
    ("type types species atomtype kind", "--where 'type == 1'|--color-by type"),
    ("hide remove exclude delete skipparts", "--where 'CONDITION'|--parts LIST"),
    ("id particleid index indices", "--set select.ids=1-100|--where 'id == 1'"),
    ("subsample decimate nth sparse thin downsample maskpoints", "--set select.every=N"),
    ("group layer body bodies phase block component", "--parts LIST"),
    (
        "box bbox boundingbox unitcell simcell simulationcell showcell showbox celledges outline wireframe",
        "--cell",
    ),
    ("cellwidth linewidth lw edgewidth", "--set cell.radius=LENGTH"),
    ("pbc periodic wraparound periodicimages", "--wrap|--replicate A,B,C"),
    ("whole wholemolecules makewhole unwrapmolecules nojump", "--unwrap"),
    ("superpose superimpose rmsfit rottrans alignto", "--align 'CONDITION'"),
    ("repeat supercell copies images multiply", "--replicate A,B,C"),
    ("bond sticks stick showbonds createbonds", "--bonds"),
    ("ballandstick ballstick licorice cpk", "--radius covalent --bonds"),
    ("spacefill spacefilling vdwspheres vanderwaals vdw", "--radius vdw"),
    (
        "r particleradius particlesize particlescale pointsize spheresize sphereradius radii markersize ms atomradius \
         diameter",
        "--radius LENGTH",
    ),
    ("structure topologyfile psf prmtop", "--topology FILE"),
    ("geometryfile stl obj boundary wall walls tank", "--mesh FILE"),
    // Look
    ("style theme preset representation rep template mode stylesheet", "--look NAME"),
    (
        "isosurface iso contour liquid fluidsurface skin molecularsurface quicksurf smooth blobs metaballs",
        "--surface smooth",
    ),
    (
        "finish material shading shader metallic glossy glass metal matte",
        "--set material.type=KIND",
    ),
    (
        "bgcolor bg backgroundcolor backgroundcolour back canvascolor white black",
        "--background COLOR",
    ),
    (
        "transparentbackground nobackground filmtransparent rgba alphachannel nobg transparentbg savealpha",
        "--transparent",
    ),
    ("floor groundplane shadowcatcher checkerboard grid floorplane", "--ground KIND"),
    ("nofloor noground hidefloor", "--ground=none"),
    ("noshadow noshadows", "--ground=none|--set render.ground_shadow=0"),
    (
        "shadow shadows castshadows softshadows floorshadow",
        "--ground shadow_catcher|--set render.ground_shadow=NUMBER",
    ),
    (
        "ao ambientocclusion ssao gi globalillumination indirectlight occlusion",
        "--bounces COUNT|--set render.indirect=ambient",
    ),
    ("maxbounces raydepth recursion tracedepth maxraydepth", "--bounces COUNT|--max-depth N"),
    ("engine raytracer tracer method raytracing pathtracing", "--integrator NAME"),
    ("light lights lighting lightdir lightdirection sky sunlight", "--set environment.type=sky"),
    ("hdri hdr envmap environmentmap ibl skybox", "--set environment.image=FILE"),
    ("lightintensity lightpower ambientlight", "--set environment.intensity=NUMBER"),
    ("exposure brightness gain gamma ev", "--set output.preview_exposure=STOPS"),
    (
        "tonemap tonemapping tonemapper agx filmic aces displaytransform colormanagement viewtransform",
        "--set output.view_transform=agx",
    ),
    ("denoiser noise nonoise despeckle", "--denoise"),
    ("nodenoise", "--denoise=false"),
    ("nobonds", "--bonds=none"),
    ("hq3d watersurface", "--look water"),
    // Frames
    (
        "start first begin startframe framestart firstframe end stop endframe frameend lastframe framerange b e \
         last stride framestep everynth",
        "--frames 10-100x5|--frame NUMBER",
    ),
    (
        "step timestep snapshot framenumber t f n iteration timeindex tstep",
        "--frame NUMBER|--frames NUMBER",
    ),
    ("framerate rate framespersecond", "--fps RATE|--set output.fps=RATE"),
    ("dt timebetweenframes", "--set output.frame_time=TIME"),
    // Files
    (
        "o out outfile outputfile save saveas savefig dest destination filename outdir outputdir outputdirectory outpath \
         folder prefix format outputformat png jpg jpeg tiff exr w",
        "--output FILE",
    ),
    (
        "i in input infile inputfile data file dataset load",
        "files need no option: spherule COMMAND FILES",
    ),
    (
        "config conf settings configfile manifest parameters params json toml",
        "a manifest needs no option: spherule COMMAND job.toml",
    ),
    ("option key param define", "--set KEY=VALUE"),
    ("y yes overwrite replace clobber", "--force"),
    ("dryrun estimate plan", "spherule check prints what a render would do"),
    (
        "info listattributes list attributes describe stats",
        "spherule inspect prints the attributes of files",
    ),
    (
        "video animate animation mp4 gif makemovie avi movie",
        "--movie FILE|spherule movie writes movies of jobs",
    ),
    ("montage contactsheet panels panel", "spherule sheet writes a sheet of the pictures of a job"),
    ("aov aovs passes layers renderpasses extrachannels planes depthmap", "--channels LIST"),
    ("compress", "--set output.compression=NAME"),
    // Execution
    (
        "j jobs cores procs nproc np nthreads numthreads numprocs workers cpus parallelism ncpu",
        "--threads COUNT",
    ),
    ("mem memory maxmemory ram maxmem", "--memory-limit SIZE"),
    ("resume continue restart", "the same command continues a job"),
    ("bvh kdtree acceleration", "--accelerator NAME"),
    ("cuda vulkan optix rtx usegpu", "--device gpu"),
];

/// The hints for an option `name`, without hyphens at its beginning.
pub(super) fn hints_for(name: &str) -> impl Iterator<Item = &'static str> {
    let name = name.replace(['-', '_', '.'], "").to_ascii_lowercase();
    let found = GUESSES.iter().find(|(words, _)| words.split_whitespace().any(|word| word == name));
    found.into_iter().flat_map(|(_, hints)| hints.split('|'))
}
