//! The closed set of what can be wrong, and of what is worth a word: one code for each kind of thing.
//!
//! To add one: a row in the table below. Name, exit code and the table of the guide follow from it.

use std::fmt;

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What kind of failure it was; fixes the exit code of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// Input or usage is wrong: exit code 2.
    Input,
    /// The problem was understood but not converged or not identifiable: exit code 3.
    Unsolved,
}

macro_rules! codes {
    ($($kind:ident $title:literal { $($code:ident $name:literal $meaning:literal,)+ })+) => {
        /// What is wrong with what, or what was noticed of what: errors, notices and findings say it, and programs may rely on its name.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Code {
            $($(
                #[doc = $meaning]
                $code,
            )+)+
        }

        impl Code {
            /// Every code, in the order of the table.
            pub const ALL: &[Self] = &[$($(Self::$code,)+)+];

            /// Their names, in the same order.
            const NAMES: &[&str] = &[$($($name,)+)+];

            /// Stable name for programs, `snake_case`.
            pub const fn name(self) -> &'static str {
                match self {
                    $($(Self::$code => $name,)+)+
                }
            }

            /// What it says, in a phrase.
            pub const fn meaning(self) -> &'static str {
                match self {
                    $($(Self::$code => $meaning,)+)+
                }
            }

            /// What it is about.
            pub const fn group(self) -> &'static str {
                match self {
                    $($(Self::$code)|+ => $title,)+
                }
            }

            /// What kind of failure an error of this code is.
            pub const fn kind(self) -> ErrorKind {
                match self {
                    $($(Self::$code)|+ => ErrorKind::$kind,)+
                }
            }
        }
    };
}

codes! {
    Input "Files and folders" {
        FileMissing "file_missing" "a file or folder is not there",
        FileForbidden "file_forbidden" "the permissions of a file or folder do not allow it",
        FileFailed "file_failed" "the system could not read or write a file",
        FileNotRegular "file_not_regular" "a folder, pipe or device stands where a file is wanted, or a file where a folder is",
        FileTooLarge "file_too_large" "a file is larger than files of its kind are, or than fits into memory",
        FileEmpty "file_empty" "a file has no content, rows or markers",
        TextEncoding "text_encoding" "a text is not UTF-8, or holds zero bytes",
        NameUnprintable "name_unprintable" "a name has control characters",
    }
    Input "Results" {
        OutputExists "output_exists" "the file or folder to be written exists already",
        OutputForeign "output_foreign" "a folder for results holds what this program did not write",
        OutputBusy "output_busy" "another run is writing into the folder",
        OutputName "output_name" "a file or folder of the result cannot have this name",
        OutputIsInput "output_is_input" "a file of the result would overwrite the input",
        OutputFailed "output_failed" "a result could not be encoded or written",
        MemoryExhausted "memory_exhausted" "the memory that the program may take was not enough",
    }
    Input "Command line and settings" {
        OptionMissing "option_missing" "an option that is needed is not given",
        OptionRange "option_range" "the value of an option is out of its range",
        OptionConflict "option_conflict" "two options exclude each other",
        PlanContradiction "plan_contradiction" "no plan fulfils the limits that were asked for",
        ParameterUnknown "parameter_unknown" "no parameter has this name",
        ParameterNotFixable "parameter_not_fixable" "a pose has no nominal value to fix or to give a prior",
        PriorUnit "prior_unit" "a prior is given in another unit than its parameter has",
        LensUnknown "lens_unknown" "no lens model has this name",
        FaultUnknown "fault_unknown" "no fault of a simulation has this name",
        SettingSyntax "setting_syntax" "a settings file is no TOML, JSON or YAML, or has unknown keys or values of another type",
        SettingVersion "setting_version" "a file has another format number than this program reads",
        SettingMissing "setting_missing" "a key that is needed is missing",
        SettingRange "setting_range" "the value of a key is out of its range",
        SettingConflict "setting_conflict" "keys exclude each other, or one of a pair is missing",
        ModelNotCompared "model_not_compared" "a robot model takes no part in the choice, as its fit has no evidence",
        LensChosen "lens_chosen" "of several lenses the simplest that explains the markers was chosen",
        SettingUnsupported "setting_unsupported" "a key is part of the format, and this program does not use it yet",
        RepeatabilityUnused "repeatability_unused" "a stated repeatability is not used: the joint noise is estimated",
    }
    Input "Tables" {
        CsvSyntax "csv_syntax" "a line is no CSV",
        CsvSeparator "csv_separator" "columns are separated by something else than commas",
        CsvCellCount "csv_cell_count" "a row has more or fewer cells than there are columns",
        CsvColumnMissing "csv_column_missing" "a column that is needed is missing",
        CsvColumnUnknown "csv_column_unknown" "a column has no name, or one that is not known",
        CsvColumnTwice "csv_column_twice" "two columns have one name",
        CsvCellEmpty "csv_cell_empty" "a cell that is needed is empty",
        CsvNumber "csv_number" "a cell is not a number",
        CsvRange "csv_range" "the value of a cell is out of its range",
        CsvName "csv_name" "a cell does not name what its column wants",
        CameraUnknown "camera_unknown" "a table names a camera that series.toml does not have",
        StopUnknown "stop_unknown" "a table names a stop that joints.csv does not have",
        CsvRowTwice "csv_row_twice" "two rows say the same thing",
        RowsByTime "rows_by_time" "rows of a series stand in another order than their times",
    }
    Input "Robot description" {
        UrdfSyntax "urdf_syntax" "a robot description is no well-formed URDF, or readers take it differently",
        UrdfXacro "urdf_xacro" "a robot description is an unexpanded xacro",
        UrdfTwice "urdf_twice" "two links or joints have one name, or an element of a joint is given twice",
        UrdfElement "urdf_element" "a name, an element or attribute of a joint is missing, misspelt or of an unknown kind",
        UrdfNumber "urdf_number" "an attribute is not as many finite numbers as it should be",
        UrdfRotation "urdf_rotation" "a quaternion or rotation is none",
        UrdfAngleUnit "urdf_angle_unit" "angles exceed a full turn: degrees for radians?",
        UrdfLengthUnit "urdf_length_unit" "links are too long: millimetres for metres?",
        UrdfAxis "urdf_axis" "the axis of a joint is zero, missing or not of unit length",
        UrdfUnlimited "urdf_unlimited" "a joint states no limits: what counts as its range is assumed",
        UrdfLimits "urdf_limits" "the limits of a joint leave no room to move",
        UrdfMassPlaceholder "urdf_mass_placeholder" "all links have one mass: a placeholder",
        UrdfMassesMissing "urdf_masses_missing" "gravity is to be taken into account, and the links have no masses",
        UrdfLayout "urdf_layout" "the text of a robot description cannot be edited in place",
        PayloadRange "payload_range" "a payload has no possible mass or centre",
        LinkUnknown "link_unknown" "no link has this name",
        TreeBroken "tree_broken" "links and joints form no tree",
        RootAmbiguous "root_ambiguous" "there are several root links, and none was named as base",
        TipAmbiguous "tip_ambiguous" "there are several leaf links, and none was named as tip",
        SecondArmRenamed "second_arm_renamed" "the second arm has names of the first, and got a prefix",
        TipChosen "tip_chosen" "of several leaf links one was chosen as tip",
        ChainImpossible "chain_impossible" "between base and tip no joint moves, or there is no way, or a joint without a single reading",
        MimicBroken "mimic_broken" "a mimic joint follows nothing that moves",
        JointUnknown "joint_unknown" "the robot has no joint of this name",
        RobotDiffers "robot_differs" "two descriptions, or a result and a description, are not of the same chain",
    }
    Input "Joint readings" {
        JointUnitMissing "joint_unit_missing" "nothing states whether joint readings are degrees or radians",
        DegreesAsRadians "degrees_as_radians" "readings said to be radians are degrees",
        RadiansAsDegrees "radians_as_degrees" "readings said to be degrees are radians",
        CountsAsAngles "counts_as_angles" "readings said to be angles are counts of encoders",
        MillimetresAsMetres "millimetres_as_metres" "readings of a prismatic joint are millimetres, centimetres, inches or feet",
        JointMissing "joint_missing" "a joint of the chain has no readings",
        JointColumnsEqual "joint_columns_equal" "two joints that move read the same at every stop",
        JointUnused "joint_unused" "readings are of no joint of the chain",
        JointUnusedMoves "joint_unused_moves" "readings of no joint of the URDF differ from stop to stop",
        CovariatesUnused "covariates_unused" "measured torques or temperatures are not used",
        JointBeyondLimits "joint_beyond_limits" "readings are beyond the limits of the joint",
        PosesOfTool "poses_of_tool" "poses of a controller that are said to be of the flange are those of a tool",
        PosesInFrame "poses_in_frame" "poses of a controller that are said to be in the base are in another frame",
        PosturesByImages "postures_by_images" "what was seen at the stops tells in which postures the poses of a controller were reached, or that it does not",
        PosturesFromPoses "postures_from_poses" "joint readings were computed from poses of the controller by inverse kinematics",
        ReadingsMissing "readings_missing" "no row has joint readings",
    }
    Input "Series" {
        SeriesMissing "series_missing" "a folder is no series",
        SeriesTwice "series_twice" "two series have one name",
        SeriesRepeated "series_repeated" "a series has the readings and measurements of another one, to the last digit",
        SeriesChanged "series_changed" "a file changed while it was read",
        SeriesDisagree "series_disagree" "series that share robot or camera contradict each other",
        ImageNotThere "image_not_there" "the file of an image that a table names is missing",
        ImageUnlisted "image_unlisted" "an image that no row names is not used",
        MeasurementDuplicate "measurement_duplicate" "measurements of a tracker or of contacts are written again, in the same series or another, to the last digit, and are left out",
        ImageDuplicate "image_duplicate" "an image shows exactly what another one shows, and is left out",
        ImageExcluded "image_excluded" "an image is left out because the caller does not want it",
        MarkersTooFew "markers_too_few" "an image shows fewer markers than a pose needs, and is left out",
        ImageContradictory "image_contradictory" "most of what was found in an image contradicts the other images, and it is left out",
        MarkersCollinear "markers_collinear" "the markers of an image lie on a line, and it is left out",
        WronglyPaired "wrongly_paired" "image and joint readings of a stop do not belong together, or the robot moved: it is left out",
        ImageTwice "image_twice" "two images have one name",
        ImagesMissing "images_missing" "images are needed, and there are none",
        ObservationsMissing "observations_missing" "images of joints.csv have no observations",
        TargetLost "target_lost" "rows of a tracker at (0, 0, 0) are no measurements: they are left out",
        MeasurementsTooFew "measurements_too_few" "a body on the tip was measured at too few stops",
        MarkerUnknown "marker_unknown" "the plate has no such marker",
    }
    Input "Plate" {
        MarkerMisplaced "marker_misplaced" "a marker is not where its id puts it",
        MarkersOverlap "markers_overlap" "two markers overlap",
        PlateScaleUnlikely "plate_scale_unlikely" "a measured distance is far from the nominal one",
        PlateUnitUnlikely "plate_unit_unlikely" "a plate is too large: millimetres for metres?",
        PlateNotDetectable "plate_not_detectable" "no detector can find a plate as described",
        DictionaryUnknown "dictionary_unknown" "no dictionary of markers has this name",
        DictionaryGuessed "dictionary_guessed" "dictionary and size of the tags were found by trial",
        PlateSymmetric "plate_symmetric" "the plate looks the same after a turn",
        PlatesAlike "plates_alike" "plates of several series are described alike, and taken for one",
        PlateImpossible "plate_impossible" "a plate cannot be designed, resolved, drawn or fitted on its sheet as asked for",
    }
    Input "Images" {
        ImageTruncated "image_truncated" "the file of an image is empty or cut off",
        ImageUnreadable "image_unreadable" "the file of an image cannot be decoded",
        ImageSizeImpossible "image_size_impossible" "an image is too small to show anything, or larger than is read or drawn",
        ImageSizeDiffers "image_size_differs" "an image has another size or depth than the others",
        ImageDepth "image_depth" "pixels do not fit the stated number of bits",
        HotPixels "hot_pixels" "single pixels of an image that are far from all their neighbours were replaced",
        FewGreyLevels "few_grey_levels" "an image has so few grey levels that its edges jump from pixel to pixel",
        MarkersBright "markers_bright" "the markers are brighter than the ground and measured in the negative",
        ImagePages "image_pages" "an image file holds several pages, of which one is taken",
        ImageTurned "image_turned" "viewers turn or mirror an image as its EXIF data ask; here pixels are as the sensor gave them",
        FlatFieldDrift "flat_field_drift" "dark or white images of the end differ from those of the begin",
        FlatFieldLeftOut "flat_field_left_out" "dark and white images are not applied to an image of few grey levels",
        FlatFieldUnused "flat_field_unused" "dark or white images lie where they are of no camera",
        FlatFieldUseless "flat_field_useless" "white images are saturated, or not brighter than dark ones",
    }
    Input "Detection" {
        PlateNotFound "plate_not_found" "nothing in the image looks like the plate",
        PlateIncomplete "plate_incomplete" "too little of the plate is seen to tell which part it is",
        PlateTurnOpen "plate_turn_open" "the dots that tell how a grid is turned are not seen",
        PlateMirrored "plate_mirrored" "the plate is seen in a mirror, or described mirrored",
        PlateContradicted "plate_contradicted" "the pattern that is seen is not that of the plate file",
        PlateLineHidden "plate_line_hidden" "a whole line of the plate is not seen where it should be",
        PlateTwice "plate_twice" "markers of the plate are seen in two places: two equal plates",
        PlateNowhere "plate_nowhere" "no image can be used",
        MarkersUnmeasured "markers_unmeasured" "most identified markers of an image cannot be measured",
        MarkersSmoothed "markers_smoothed" "markers of an image whose edges are clipped or spoilt were measured in a smoothed copy of it",
        BlurAsymmetric "blur_asymmetric" "edges are blurred more to one side: coma or motion",
    }
    Input "Recordings" {
        RecordingFormat "recording_format" "a file is no recording that can be read",
        RecordingNotConverted "recording_not_converted" "a recording stands where a series folder is wanted",
        RecordingDamaged "recording_damaged" "a recording is damaged, cut off, or was not closed",
        RecordingManifest "recording_manifest" "nothing beside a recording describes camera and plate",
        TopicMissing "topic_missing" "no topic carries what is needed",
        TopicAmbiguous "topic_ambiguous" "several topics, or several cameras in one topic, carry what is needed",
        MessagesUnreadable "messages_unreadable" "messages of a topic cannot be read",
        MessagesUnstamped "messages_unstamped" "messages have no stamp",
        ClocksApart "clocks_apart" "images and joint states were not taken at the same time",
        ClockSetBack "clock_set_back" "the times of a recording or of rows go back: a clock was set, or began anew",
        ImagesDelayed "images_delayed" "images arrive later or earlier than joint states of the same stamp",
        ImageDelayFound "image_delay_found" "motion in the images tells of a delay, which is taken off",
        ImageDelayUnchecked "image_delay_unchecked" "motion in the images does not tell their delay",
        RobotNeverStill "robot_never_still" "the robot never stands still long enough",
        JointSilent "joint_silent" "joints have no readings for a part of a recording",
        JointStatesOfTwo "joint_states_of_two" "joint states of two publishers stand in one topic",
        ImagesInMotion "images_in_motion" "images were taken while the robot moved",
        ImagesUnlike "images_unlike" "images of one standstill that were averaged show different things",
        StandstillWithoutImage "standstill_without_image" "a standstill has no image",
        StopsNotRecorded "stops_not_recorded" "stops are not in the recording: images or readings are missing",
    }
    Input "Robot programs" {
        ProgramLanguage "program_language" "nothing tells the language of a program, or programs are of several languages",
        ProgramSyntax "program_syntax" "a program cannot be read at this place",
        ProgramTargets "program_targets" "a motion or target has another number of values than it needs",
        ProgramQuaternion "program_quaternion" "the quaternion of a target is not of unit length",
        ProgramTwin "program_twin" "a name is declared in several of the files",
        ProgramModelMissing "program_model_missing" "a target is a pose, and the model in the controller is not given",
        TargetsTooFew "targets_too_few" "too few targets tell of an error",
    }
    Input "Corrected programs" {
        PosesKept "poses_kept" "poses of a table stay as they are beside joints that are corrected",
        TargetsLeft "targets_left" "targets stay as they are; their reasons are counted",
        TargetsMissing "targets_missing" "no target is found in the programs",
        ProgramWritten "program_written" "targets of a program were changed; the record has the hash of its bytes",
        ProgramCopied "program_copied" "no target of a program was changed; the record has the hash of its bytes",
        CorrectedAlready "corrected_already" "a program is what an earlier correction wrote, or was made of it",
        ModelsEqual "models_equal" "both descriptions are of the same robot: nothing is corrected",
        ModelsExchanged "models_exchanged" "the nominal description is the corrected one, and the other the nominal one",
        CompensationNotGiven "compensation_not_given" "the compensation.toml beside a description is not used",
        NominalIsControllers "nominal_is_controllers" "the nominal model is the one in the controller",
        NominalDiffers "nominal_differs" "the nominal model is not the one in the controller",
        TaughtWithOtherFrames "taught_with_other_frames" "joints and poses were taught with another tool or base",
        ControllerBase "controller_base" "poses of URScript in another base than that of the controller",
        FramesDiffer "frames_differ" "base or tool are not those of the program",
        DisplacedOrientation "displaced_orientation" "displaced targets are turned as the points that they start from",
        ExpectedError "expected_error" "how far the tool is expected from where the program meant it",
        ExpectedErrorUnknown "expected_error_unknown" "it is not known how far the tool will be from where the program meant it",
    }
    Input "Earlier results" {
        SolutionDamaged "solution_damaged" "a solution.json is not as the program wrote it",
        SolutionDiffers "solution_differs" "a solution.json is of another robot or series",
        SolutionUntrusted "solution_untrusted" "the solution.json that is used failed checks of its own",
        StatedExceeded "stated_exceeded" "a model misses more in another measurement than its solution states",
        OwnMeasurement "own_measurement" "a model is judged by what it was fitted to",
        ModelsNotTold "models_not_told" "a measurement does not tell a model from the nominal one",
        NotCorrected "not_corrected" "a model misses as much as robots that nobody corrected",
    }
    Unsolved "Geometry that does not fit" {
        CameraUndetermined "camera_undetermined" "the images do not determine the camera",
        ViewsAlike "views_alike" "the images are all alike",
        FocalNotFound "focal_not_found" "no focal length explains the markers",
        LensUndecided "lens_undecided" "nothing tells one lens from another",
        ImagesTooFew "images_too_few" "too few images of the robot show the plate",
        StopsAlike "stops_alike" "the stops turn the hand too little",
        ReadingsContradict "readings_contradict" "joint readings and images do not belong together",
        SharedPoseDiffers "shared_pose_differs" "images fit by themselves, and not with the camera mounting or plate placement that they share with others",
        JointSignWrong "joint_sign_wrong" "with joints negated the images, or measurements, fit",
        JointOrderWrong "joint_order_wrong" "with joints exchanged the images fit",
        JointInfluenced "joint_influenced" "a joint moves with a part of the reading of another",
        JointRatioWrong "joint_ratio_wrong" "a joint moves by another ratio than it is read by",
        JointCoupled "joint_coupled" "with a joint counted from the joint before it, and not from the ground, the images fit",
        JointUnitWrong "joint_unit_wrong" "with the unit of single joints changed the images fit",
        RotationConvention "rotation_convention" "poses of the controller, or of a tracker, follow another convention of rotation than is stated",
        PosesInverted "poses_inverted" "with the poses of the controller, or of a tracker, inverted everything fits",
        MeasuredUnit "measured_unit" "measured positions are not in metres",
        AxesMirrored "axes_mirrored" "the axes of a tracker are left-handed, or joints count the other way as in the mirror image of the arm",
        PoseOutOfReach "pose_out_of_reach" "the nominal robot reaches no such pose",
        JointReadingsWrong "joint_readings_wrong" "the readings of one joint are wrong at some stops",
        PicturesExchanged "pictures_exchanged" "pictures of two cameras stand in the place of each other at some stops",
        TargetsExchanged "targets_exchanged" "rows of two targets of a tracker stand in the place of each other at some stops",
        ReadingsExchanged "readings_exchanged" "images that were left out fit the readings of each other",
        RowsMisordered "rows_misordered" "with the rows in the other order of the images' names (1, 2, .. 10 or 1, 10, .. 2) the images fit",
        RowsShifted "rows_shifted" "with the rows of joints.csv shifted by one the images fit; of a tracker, all or a part of its rows",
        CameraMountWrong "camera_mount_wrong" "with the camera mounted the other way the images fit",
        ImagesMirrored "images_mirrored" "with the images mirrored they fit the joint readings",
        LinkLengthsWrong "link_lengths_wrong" "directions fit and distances do not: another size of robot",
        PlatePitchWrong "plate_pitch_wrong" "with a plate of another size the images fit",
    }
    Unsolved "Fit" {
        NotConverged "not_converged" "the adjustment ended without converging",
        ViewsFrontal "views_frontal" "all views look straight at the plate",
        FitUndetermined "fit_undetermined" "the data do not determine all unknowns",
        EstimateNotFinite "estimate_not_finite" "an estimate is not finite",
        NothingHeldOut "nothing_held_out" "too few images to hold any out, or none that can be predicted",
        PointsUndetermined "points_undetermined" "measured points do not determine the frame of the device, or leave open most of what the robot may miss",
        PointsContradict "points_contradict" "measured points and readings do not belong together",
        CameraFileImpossible "camera_file_impossible" "no camera model of a format expresses a lens, or comes near to it",
        OriginNotWritten "origin_not_written" "an origin cannot be written into the robot description",
        RecordNotWritten "record_not_written" "a record cannot be encoded",
    }
    Unsolved "Findings" {
        Noticed "noticed" "a notice of an earlier version of the program, which gave it no code of its own",
        CameraModelMisfit "camera_model_misfit" "the camera model does not explain the markers",
        ResidualPattern "residual_pattern" "the residuals show a pattern that noise does not leave",
        Extrapolates "extrapolates" "outside the region of the stops the flange is known badly",
        MirrorImageFits "mirror_image_fits" "nothing in the data tells the arm from its mirror image",
        HeldNearNominal "held_near_nominal" "outside the region of the stops the robot is held near the nominal one",
        HeldContradicted "held_contradicted" "the data contradict values at which parameters are held",
        FewImages "few_images" "few images: the nominal model decides much of the result",
        FocusChanged "focus_changed" "focus or zoom changed during the series",
        ReadingsRounded "readings_rounded" "joint readings were rounded to a step that is as large as the joint noise",
        JointNoiseLarge "joint_noise_large" "the joint noise is larger than robots have, or far larger than in another series of the robot",
        CamerasContradict "cameras_contradict" "cameras that see the same stops contradict each other from stop to stop",
        JointNoiseContradicted "joint_noise_contradicted" "the data show another joint noise than the stated one",
        PlateMoved "plate_moved" "the plate was moved: images were left out",
        CameraMoved "camera_moved" "the camera was moved on its mount: images were left out",
        ImagesTurned "images_turned" "images are turned about the optical axis against the others: they were left out",
        IdsReversed "ids_reversed" "ids of some images are counted from the other end of the plate: they were left out",
        ImagesShifted "images_shifted" "some pictures of a camera are cut out elsewhere than the others",
        PlateDisplaced "plate_displaced" "the plate stands a little elsewhere from some image on, or by turns",
        CameraDisplaced "camera_displaced" "the camera sits a little elsewhere from some image on",
        PlateDrifts "plate_drifts" "the plate creeps all through the series",
        CameraDrifts "camera_drifts" "the camera creeps all through the series",
        PlateLoose "plate_loose" "the plate tilts with gravity",
        CameraLoose "camera_loose" "the camera tilts with gravity",
        TrackerDisplaced "tracker_displaced" "a tracker stands elsewhere from some stop on, or in one of several series",
        TrackerDrifts "tracker_drifts" "a tracker creeps all through the series",
        TargetDisplaced "target_displaced" "a target or a ball sits elsewhere on the tip from some stop on, or in one of several series",
        TargetDrifts "target_drifts" "a target or a ball creeps on the tip all through the series",
        ZeroMoved "zero_moved" "the zero of a joint is another from some stop on, or in one of several series",
        PlateSizeContradicted "plate_size_contradicted" "robot and plate file disagree on the size of the plate",
        LengthsContradicted "lengths_contradicted" "what a tracker, given places or measured distances say contradicts the lengths of the robot's links and all else",
        PlateUneven "plate_uneven" "the plate is stretched more one way than the other",
        MeasurementsLeftOut "measurements_left_out" "measurements of trackers or contacts do not fit the others, and are left out",
        MeasurementsRepeated "measurements_repeated" "a tracker wrote the same at successive stops though the arm had moved on: these are left out",
        MeasurementsScatter "measurements_scatter" "measurements of a tracker or of contacts scatter more than their stated sigma says",
        ImagesLeftOut "images_left_out" "many images were left out",
        ObservationsLeftOut "observations_left_out" "many observations were left out",
        LensNotInRos "lens_not_in_ros" "camera.yaml cannot express the lens",
        LooseMounting "loose_mounting" "camera or plate is loose on its mount",
        MarkerOff "marker_off" "a marker is far from where the plate file says",
        TagsOff "tags_off" "the tags of a plate have another size beside their distance than the plate file says",
        NoGain "no_gain" "the calibrated robot is not shown to be better than the nominal one",
        SmallGain "small_gain" "the calibrated robot is hardly better than the nominal one",
        OddImage "odd_image" "an image is predicted far worse than the others",
        ParameterOff "parameter_off" "a parameter is far from what robots usually have",
        LargeScatter "large_scatter" "images scatter more than the noise model says",
        ZeroOff "zero_off" "the zero of a joint is far from that of the URDF, or it counts the other way",
        FlangeUndetermined "flange_undetermined" "the data do not determine the flange",
    }
    Input "Touches" {
        TouchUnit "touch_unit" "touched places or their sigma are not in metres",
        TouchesFew "touches_few" "too few touches for tool or work object",
        TouchesOnLine "touches_on_line" "the touched places lie on a line",
        TouchesNotTurned "touches_not_turned" "the tip was not turned between touches",
    }
    Unsolved "Tool and work object" {
        FramesUndetermined "frames_undetermined" "touches do not determine tool and work object together",
        FrameWeak "frame_weak" "a direction of tool or work object is hardly told",
        TouchesLeftOut "touches_left_out" "touches disagree with the others, and are left out",
        ReadingsOfOtherZeros "readings_of_other_zeros" "touches, or a series that judges a robot, fit with their readings taken on the other side of the mastering",
        TouchesScatter "touches_scatter" "touches scatter more than their stated sigma says",
        TouchesExact "touches_exact" "touches have the joint values of their plan, or fit far better than their stated sigma lets them: they were computed, not made",
        RobotContradicted "robot_contradicted" "touches say of the robot what the solution excludes",
        ToolContradicted "tool_contradicted" "the tool that was given is not where the touches have it",
        PlaceContradicted "place_contradicted" "a place that was touched is not where the other touches have it",
        TouchedFromBelow "touched_from_below" "the tool came from below the plane of the touched places",
        WorkCarried "work_carried" "a work object is stated in a link that the joints of the robot move",
        WorkNotCarried "work_not_carried" "touched places do not go with the base of the solution, which joints of the robot move",
        WorkDisplaced "work_displaced" "the work object, a socket, or the fixture of all sockets or given places, stands elsewhere from some touch on, or in one of several series",
        FramesUnknown "frames_unknown" "base and tool of the real robot are known worse than the correction is large",
        FramesNominal "frames_nominal" "base and tool were taken as nominal, as asked for",
    }
    Unsolved "Planning and simulation" {
        PlanTooFewPoses "plan_too_few_poses" "too few workable poses were found",
        PlanUndetermined "plan_undetermined" "planned images do not determine what they shall",
        PlanViewless "plan_viewless" "no view shows enough of the plate",
        PlanOutOfReach "plan_out_of_reach" "no workable view is in reach",
        PlanCollides "plan_collides" "every view in reach collides or is beyond the limits",
        PlateCodeWeak "plate_code_weak" "windows of a plate's code differ in too few cells",
        SimulationOutOfReach "simulation_out_of_reach" "no view of the plate is in reach of a simulated robot",
    }
}

impl Code {
    /// What stands for the code of a notice that an earlier version wrote without one.
    pub(crate) const fn of_earlier_versions() -> Self {
        Self::Noticed
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Serialize for Code {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// By its name. What serde derives for so many is much code.
impl<'de> Deserialize<'de> for Code {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let found = Self::ALL.iter().find(|code| code.name() == name).copied();
        found.ok_or_else(|| Error::unknown_variant(&name, Self::NAMES))
    }
}

#[cfg(test)]
mod tests {
    use super::Code;

    #[test]
    fn a_code_is_written_and_read_by_its_name_alone() {
        for (code, name) in Code::ALL.iter().zip(Code::NAMES) {
            assert_eq!(code.name(), *name);
            let text = serde_json::to_string(code).unwrap();
            assert_eq!(text, format!("\"{name}\""));
            assert_eq!(serde_json::from_str::<Code>(&text).unwrap(), *code);
        }
        let refused = serde_json::from_str::<Code>("\"no_such_code\"").unwrap_err().to_string();
        assert!(refused.contains("no_such_code") && refused.contains(Code::Noticed.name()), "{refused}");
        assert!(serde_json::from_str::<Code>("3").is_err());
    }
}
