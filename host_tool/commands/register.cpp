#include "protocol/base/try.h"
#include "stitch/registration/registration.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <ctime>
#include <utility>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/expected_time.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/commands/lens_json.h"
#include "host_tool/commands/nominal_options.h"
#include "host_tool/commands/picture_places_option.h"
#include "host_tool/commands/register_output.h"
#include "host_tool/commands/replay_toml.h"
#include "host_tool/commands/sphere_options.h"
#include "host_tool/commands/trial.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/input/own_pictures.h"
#include "host_tool/input/pairs_file.h"
#include "host_tool/input/registration_advice.h"
#include "host_tool/report/registration_report.h"
#include "host_tool/report/verdict.h"
#include "stitch/registration/pairs.h"

namespace nodal::host {
namespace {

using registration::Options;
using registration::Report;

/// The bar of the whole command: of pictures alone, points are matched until kMatched.
constexpr std::uint64_t kMatched = 500, kRegistered = 1'000;

struct RegisterArgs {
  std::vector<std::string> inputs;
  NominalWords nominal;
  std::string pairs, report, rig_toml;
  std::string out = "calibration.json";
  std::string free = "rotations", norm = "sum", colour = "luminance", vignetting = "own", gauge;
  bool no_search = false;
  int sets = kLiveSets;
  bool trial = false;
  PicturePlaces places = PicturePlaces::kBesideProject;
  std::string limit = "60s";
  std::string up = "auto", split = "auto";
  bool chosen = false;  ///< whether an option says what is estimated, or how
  Options options;
};

template <class Value>
using Choices = std::map<std::string, Value>;
/// What a word changes in Options, which hold nothing but rotations to be free.
const Choices<void (*)(Options&)> kFree{
    {"light", [](Options& options) { options.geometry = false; }},
    {"rotations", [](Options&) {}},
    {"distance", [](Options& options) { options.distance = true; }},
    {"focals", [](Options& options) { options.free = registration::Free::kFocals; }},
    {"lens", [](Options& options) { options.free = registration::Free::kLens; }}};
const Choices<registration::Norm> kNorm{{"sum", registration::Norm::kSum}, {"max", registration::Norm::kMax}};
const Choices<registration::Colour> kColour{{"luminance", registration::Colour::kLuminance},
                                            {"rgb", registration::Colour::kRgb}};
const Choices<registration::VignettingModel> kVignetting{{"fixed", registration::VignettingModel::kFixed},
                                                         {"shared", registration::VignettingModel::kShared},
                                                         {"own", registration::VignettingModel::kOwn}};
const Choices<registration::Gauge> kGauge{{"first", registration::Gauge::kFirstHead},
                                          {"mean", registration::Gauge::kMean},
                                          {"most", registration::Gauge::kMedian}};

template <class Value>
CLI::IsMember one_of(const Choices<Value>& choices) {
  std::vector<std::string> names;
  for (const auto& [name, value] : choices) names.push_back(name);
  return CLI::IsMember(names);
}

/// Tells what is to be told of the pictures, once.
void tell_notes(Console& console, RigPictures& rig) {
  for (const std::string& note : std::exchange(rig.notes, {})) console.note("note: " + note);
}

/// Pictures without a calibration: one set of them, calibrated.
Result<RigPictures> calibrated_alone(Console& console, const RegisterArgs& args, RigPictures rig, Progress& bar) {
  tell_notes(console, rig);
  say_time(console, registration_of(rig, true));
  NODAL_TRY(interruptible(console, [&] {
    return calibrate_by_pictures(rig, parse_up(args.up).value(), [&](double done, const std::string& what) {
      bar.update(static_cast<std::uint64_t>(kMatched * done), what);
    });
  }));
  std::vector<HeadPicture> matched = std::move(rig.sets[rig.match->set]);
  rig.sets.clear();
  rig.sets.push_back(std::move(matched));
  rig.match->set = 0;
  return rig;
}

/// All pictures are decoded.
Result<RigPictures> read_input(Context& context, const RegisterArgs& args, Progress& bar) {
  Console& console = context.console();
  if (args.inputs.empty()) {
    const std::string what = "registering a running rig";
    NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
    Result<RigPictures> pulled = pull_frame_sets(*rig, what, args.sets, console);
    const bool by_sheet = !args.nominal.rig.empty();
    if (pulled && by_sheet) return by_data_sheet(std::move(*pulled), args.nominal);
    if (pulled || pulled.error().code != Errc::kNotFound || args.trial) return pulled;
    if (by_sheet) {
      NODAL_TRY_ASSIGN(RigPictures frames, pull_uncalibrated_set(*rig, what, console));
      return by_data_sheet(std::move(frames), args.nominal);
    }
    console.note("note: the rig has no calibration; everything is found in one set of its frames");
    NODAL_TRY_ASSIGN(RigPictures alone, pull_uncalibrated_set(*rig, what, console));
    rig.reset();  // matching takes longer than a rig waits for a host
    return calibrated_alone(console, args, std::move(alone), bar);
  }
  if (args.nominal.rig.empty() && is_picture(args.inputs.front())) {
    NODAL_TRY_ASSIGN(RigPictures own, own_pictures(args.inputs, parse_split(args.split).value()));
    return calibrated_alone(console, args, std::move(own), bar);
  }
  return interruptible(console, [&] {
    return read_all_pictures(args.nominal, args.inputs, {args.places, parse_split(args.split).value()});
  });
}

/// The options that the words of the command line mean.
Options options_of(const RegisterArgs& args, RigPictures::Origin origin) {
  Options options = args.options;
  kFree.at(args.free)(options);
  options.norm = kNorm.at(args.norm);
  options.colour = kColour.at(args.colour);
  options.vignetting = kVignetting.at(args.vignetting);
  // On a running rig, the heads that have not moved must not be rotated because of the one that has.
  options.gauge = !args.gauge.empty()                   ? kGauge.at(args.gauge)
                  : origin == RigPictures::Origin::kRig ? registration::Gauge::kMedian
                                                        : registration::Gauge::kFirstHead;
  options.search = !args.no_search && origin != RigPictures::Origin::kPictures;
  // A data sheet gives a field of view, but no lens.
  options.lens_far_off = origin == RigPictures::Origin::kDataSheet;
  options.lens_kind_assumed = options.lens_far_off && args.nominal.lens == NominalWords().lens;
  return options;
}

/// Pictures without a calibration are registered as `nodal stitch` registers them, unless `chosen`.
Result<Report> registered(Console& console, const RigPictures& rig, Options options, bool chosen, Progress& bar) {
  const std::uint64_t begun = rig.match ? kMatched : 0;
  if (rig.match && !chosen) {
    return interruptible(console, [&]() -> Result<Report> {
      return registered_alone(rig, [&](double done, const std::string& what) {
        bar.update(begun + static_cast<std::uint64_t>(static_cast<double>(kRegistered - begun) * done), what);
      });
    });
  }
  options.progress = [&](const registration::Step& step, double done) {
    bar.update(
        begun + static_cast<std::uint64_t>(static_cast<double>(kRegistered - begun) * done),
        fmt::format("at a width of {} px, heads differ by {:.3f} levels", step.width, std::sqrt(step.objective)));
  };
  return interruptible(console, [&] { return registration::register_heads(rig.calibration, rig.frames(), options); });
}

Status run_register(Context& context, const RegisterArgs& args) {
  Console& console = context.console();
  const Result<Duration> limit = parse_duration(args.limit);
  if (!limit) return fail(limit.error().in("--limit"));
  if (!args.rig_toml.empty() && args.inputs.empty()) {
    return fail(Errc::kMissingField, "--rig-toml: heads replay picture files; give pictures");
  }
  Progress bar(console, "registering", kRegistered);
  NODAL_TRY_ASSIGN(RigPictures input, read_input(context, args, bar));
  std::vector<std::string> replayed;
  if (!args.rig_toml.empty()) {
    NODAL_TRY_ASSIGN(replayed, replayed_files(input, args.rig_toml));
  }
  tell_notes(console, input);
  if (input.match) {
    console.note(input.match->confidence);
  } else {
    say_time(console, registration_of(input, false));
    NODAL_TRY(turn_up(input, parse_up(args.up).value()));
  }
  if (!args.pairs.empty()) {
    NODAL_TRY_ASSIGN(const auto pairs, read_pairs(args.pairs, input.calibration));
    Result<registration::PairFit> fit = interruptible(
        console, [&] { return registration::fit_to_pairs(input.calibration, pairs, registration::Free::kRotations); });
    if (!fit) return fail(fit.error().in(args.pairs));
    input.calibration = std::move(fit->calibration);
    for (const std::string& warning : fit->warnings) console.note(args.pairs + ": " + warning);
  }
  const Options options = options_of(args, input.origin);
  const auto wall = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  const Result<Report> report = registered(console, input, options, args.chosen, bar);
  if (!report) return fail(with_advice(report.error(), !args.nominal.rig.empty()));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count();
  NODAL_TRY_ASSIGN(const Verdict verdict,
                   interruptible(console, [&] { return verdict_on(report->calibration, input.frames(0)); }));
  NODAL_TRY(write_file(args.out, to_json(report->calibration)));
  if (!args.rig_toml.empty()) {
    NODAL_TRY(write_parts(input, replayed));
    NODAL_TRY_ASSIGN(const std::string toml, replay_rig_toml(report->calibration, replayed, args.out, args.rig_toml));
    NODAL_TRY(write_file(args.rig_toml, toml));
  }
  if (!args.report.empty()) {
    Report complete = *report;
    if (input.match && !input.match->lens.note.empty()) complete.warnings.push_back(input.match->lens.note);
    NODAL_TRY_ASSIGN(const HtmlReport page, interruptible(console, [&] {
                       return registration_report(input.calibration, input.frames(0), complete, verdict.sentence);
                     }));
    NODAL_TRY(write_file(args.report, page.finish()));
  }
  Json document = register_json(*report);
  if (input.match) document["lens"] = lens_json(input.match->lens);
  if (report->lens) document["lens"] = lens_json(*report->lens);
  document["out"] = args.out;
  document["verdict"] = name_of(verdict.word);
  document["seams"] = to_json(verdict, input.heads);
  document["seconds"] = seconds;
  document["cpu_seconds"] = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  console.document(document);
  const bool alone = input.match && !args.chosen, focals = options.free != registration::Free::kRotations;
  print_registration(console, *report, verdict, {alone, focals, args.out, seconds});
  const bool first = input.match || input.origin == RigPictures::Origin::kDataSheet;
  if (args.inputs.empty() && first && !args.trial) {
    console.line("put it in force with: nodal calibration upload " + args.out);
  }
  if (!args.trial) return {};
  NODAL_TRY_ASSIGN(const TrialVerdict tried, try_out(context, report->calibration, args.sets, {*limit}));
  tell_verdict(context, tried);
  return {};
}

}  // namespace

void add_register(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, "register", "Estimate how the heads are turned relative to each other, from pictures they took together",
      "  nodal register cam0.png cam1.png cam2.png -o rig.json    nothing is known but the pictures\n"
      "  nodal register rig.json cam0.png cam1.png cam2.png -o found.json\n"
      "  nodal register rig.json noon/ evening/ --free focals     folders with pictures named after the heads\n"
      "  nodal register --nominal 3x190 --free lens a.jpg b.jpg c.jpg\n"
      "  nodal register takes/000001 -o first.json                pictures of a take\n"
      "  nodal --rig ssh://rig.local register -o first.json       a running rig without a calibration\n"
      "  nodal --rig ssh://rig.local register --trial   the running rig, which keeps the result if it is better\n"
      "Gain and fall-off are estimated, too. A head that the pictures do not place is named and keeps its "
      "rotation.\n");
  auto args = std::make_shared<RegisterArgs>();
  command
      ->add_option(
          "INPUT", args->inputs,
          "The calibration to start from, or another program's project, and the pictures; pictures alone: where heads\n"
          "are and which "
          "lens they have is found in them; the folder of a take; nothing: the running rig's")
      ->type_name("");
  command->add_option("-o,--out", args->out, "The calibration found (calibration.json when not given)")
      ->type_name("FILE");
  command
      ->add_option(
          "--free", args->free,
          "What is estimated: rotations (when not given; of pictures alone, what they determine); focals: rotations\n"
          "and focal lengths; lens: rotations and whole lenses; distance: rotations and how far away the pictures\n"
          "meet, for heads with positions; light: gains and fall-off only, with the heads where they are")
      ->type_name("light|rotations|focals|lens|distance")
      ->check(one_of(kFree));
  command
      ->add_option("--vignetting", args->vignetting,
                   "Fall-off: each head's own (when not given), shared by all, or fixed")
      ->type_name("own|shared|fixed")
      ->check(one_of(kVignetting));
  add_layout_option(*command, args->options.layout, "Layout of the raymap on which heads are compared");
  command
      ->add_option("--width", args->options.width,
                   "Largest width of that raymap, px; as fine as the pictures when not given")
      ->type_name("PX")
      ->check(CLI::Range(64, 32768));
  command
      ->add_option(
          "--norm", args->norm,
          "What counts in each direction: sum, the differences of all heads (when not given); max, the largest one")
      ->type_name("sum|max")
      ->check(one_of(kNorm));
  command->add_option("--colour", args->colour, "Compare luminance, or red, green and blue with a gain each")
      ->type_name("luminance|rgb")
      ->check(one_of(kColour));
  command
      ->add_option("--gauge", args->gauge,
                   "What does not turn: first, the first head (files, when not given); mean, the mean of all heads;\n"
                   "most, the heads that most others agree with (a running rig, when not given)")
      ->type_name("first|mean|most")
      ->check(one_of(kGauge));
  command->add_flag("--no-search", args->no_search,
                    "Do not search: correct small errors of the directions only; heads that are far off are refused");
  command
      ->add_option("--pairs", args->pairs,
                   "First turn the heads by the point pairs of this file: CSV, .pto, .pts, .ptv")
      ->type_name("FILE");
  command
      ->add_option("--report", args->report, "Write a page to look at: the sphere, seams, differences, uncertainties")
      ->type_name("HTML");
  command->add_option("--rig-toml", args->rig_toml, "Write a rig.toml, too, with heads that replay the pictures")
      ->type_name("FILE");
  command
      ->add_option("--threads", args->options.threads,
                   "Number of threads (one for each core when not given); the result is the same")
      ->type_name("N")
      ->check(CLI::Range(1, 256));
  command->add_option("--sets", args->sets, "Frame sets to take from a running rig (3 when not given)")
      ->type_name("N")
      ->check(CLI::Range(1, kMaxLiveSets));
  CLI::Option* trial =
      command->add_flag("--trial", args->trial,
                        "Let the rig try the result: it keeps it if it is better on new frames, and else goes back");
  command->add_option("--limit", args->limit, "Time after which the rig goes back by itself (60s when not given)")
      ->type_name("DURATION")
      ->needs(trial)
      ->check(checked_by(parse_duration));
  add_split_option(*command, args->split);
  add_up_option(*command, args->up);
  add_picture_places(*command, args->places);
  add_nominal_options(*command, args->nominal);
  line.on(command, [args, command](Context& context) {
    for (const char* option :
         {"--free", "--vignetting", "--layout", "--width", "--norm", "--colour", "--gauge", "--no-search", "--pairs"}) {
      args->chosen = args->chosen || command->count(option) > 0;
    }
    return run_register(context, *args);
  });
}

}  // namespace nodal::host
