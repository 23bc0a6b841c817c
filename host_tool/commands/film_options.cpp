// The options of films.
#include "host_tool/commands/film_request.h"
#include "host_tool/commands/stitch_film.h"
#include "host_tool/film/head_clocks.h"

namespace nodal::host {

void add_coding_options(CLI::App& command, CodingArgs& args) {
  command
      .add_option("--codec", args.codec,
                  "Of a film: h264 (up to 4096 px wide when not given), h265, prores, ffv1 (lossless), or mpeg2, 15\n"
                  "Mbit/s")
      ->type_name("h264|h265|prores|ffv1|mpeg2")
      ->check(CLI::IsMember({"h264", "h265", "prores", "ffv1", "mpeg2"}));
  command.add_option("--crf", args.quality, "Of a film in h264 and h265: 0 (best) to 51 (20 and 23 when not given)")
      ->type_name("N")
      ->check(CLI::Range(0, 51));
  const std::vector<std::string> presets{"ultrafast", "superfast", "veryfast", "faster",  "fast",
                                         "medium",    "slow",      "slower",   "veryslow"};
  command
      .add_option("--preset", args.preset, "Of a film in h264 and h265: how long they search (medium when not given)")
      ->type_name("ultrafast|superfast|veryfast|faster|fast|medium|slow|slower|veryslow")
      ->check(CLI::IsMember(presets));
  command.add_flag("--preview", args.preview,
                   "Of a film: 48 of its frames at most, at their times, and 1280 px wide without --width; in seconds");
}

void add_parts_options(CLI::App& command, PartsArgs& args) {
  CLI::Option* const plan = command.add_flag(
      "--plan", args.plan, "Make the plan of a film only, in the folder OUT.parts; for several computers");
  CLI::Option* const segments = command
                                    .add_option("--segments", args.segments,
                                                "Make these parts of a film only, of 240 frames each, in that folder")
                                    ->type_name("A-B")
                                    ->check(checked_by(parse_segments));
  CLI::Option* const join = command.add_flag("--join", args.join, "Join the parts of a film that are there");
  segments->excludes(plan);
  join->excludes(plan)->excludes(segments);
}

void add_film_options(CLI::App& command, FilmArgs& args) {
  add_coding_options(command, args.coding);
  command
      .add_option(
          "--offset", args.offsets,
          "Of a film: what the first head shows at a time, this head shows SECONDS later in its own film; PPM:\n"
          "how much faster its clock runs, in millionths. Once for each head that has one")
      ->type_name("HEAD=SECONDS[,PPM]")
      ->allow_extra_args(false)
      ->check(checked_by(film::parse_head_time));
  command
      .add_option(
          "--times", args.times,
          "Of a film: what the heads' times are found in: some of sound, gyro, rotation and flash, with commas\n"
          "between them; begin, all films begin at the same instant (what decides, when not given)")
      ->type_name("SOURCE,...|begin")
      ->check(checked_by([](const std::string& text) -> Result<film::ClockSources> {
        if (text == "begin") return film::ClockSources{};
        return film::parse_clock_sources(text);
      }));
  command
      .add_option("--readout", args.readout_ms,
                  "Of a film, with --times flash: milliseconds from the first to the last row's exposure of a frame")
      ->type_name("MS")
      ->check(CLI::Range(0.0, 100.0));
  command
      .add_option("--sound", args.sound,
                  "Of a film: a head, a file, or none (the first head that has sound when not given)")
      ->type_name("HEAD|FILE|none");
  command
      .add_option("--seams", args.seams,
                  "Of a film: placed (when not given), where the pictures agree, once in 240 frames; or fixed")
      ->type_name("placed|fixed")
      ->check(CLI::IsMember({"placed", "fixed"}));
  command
      .add_option("--light", args.light,
                  "Of a film: matched (when not given), heads whose exposures drift apart get one brightness; or fixed")
      ->type_name("matched|fixed")
      ->check(CLI::IsMember({"matched", "fixed"}));
  command.add_option("--rate", args.rate, "Of a film of folders with pictures: how many a second (30 when not given)")
      ->type_name("N")
      ->check(CLI::Range(1, 1000));
  add_parts_options(command, args.parts);
}

}  // namespace nodal::host
