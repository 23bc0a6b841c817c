// How a film is made, whatever it is made of: plan, segments, join.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host_tool/commands/command.h"
#include "host_tool/film/film_plan.h"
#include "host_tool/film/frame_source.h"
#include "host_tool/film/programs.h"
#include "host_tool/film/segments.h"

namespace nodal::host {

/// The options that are for any film.
struct CodingArgs {
  std::string codec;
  int quality = -1;
  std::string preset;
  bool preview = false;
};
struct PartsArgs {
  std::string segments;
  bool plan = false;
  bool join = false;
};
/// The width of a preview, px, when the user names none.
inline constexpr int kPreviewWidth = 1280;
/// --codec, --crf, --preset, --preview.
void add_coding_options(CLI::App& command, CodingArgs& args);
/// --plan, --segments, --join.
void add_parts_options(CLI::App& command, PartsArgs& args);

/// Writes what these arguments say, and the container that the name of the result says, into `look`.
void set_coding(film::FilmLook& look, const CodingArgs& args, const std::string& out);

/// The note about a layout that a film cannot say.
std::string unknown_to_viewers(const std::string& layout);

/// What a film is made of: the films of heads, or a take.
///
/// Errors: each names the file or the option.
class FilmContent {
 public:
  virtual ~FilmContent() = default;
  /// What was asked for, by which a plan is found again.
  virtual Result<film::Json> words() = 0;
  /// The plan without placed seams. `notes`: whole sentences for the user.
  virtual Result<film::FilmPlan> plan(std::vector<std::string>& notes) = 0;
  /// Refers to the plan, in which seams may be placed later.
  virtual Result<std::unique_ptr<film::FrameSource>> source(const film::FilmPlan& plan) = 0;
  /// Adds to the document of the result; returns what the film is made from, as the end of a sentence.
  virtual std::string tell(const film::FilmPlan& plan, Json& document) = 0;
};

/// The error of --join without a plan.
tl::unexpected<Error> no_plan(const film::PartsFolder& parts);

/// Makes the film `out`, or the part of the work that `args` say, and tells it. `notes`: those that are not told yet.
/// Errors: kCancelled after Ctrl-C, with how to go on; those of the content, of ffmpeg and of the disk.
Status make_film(Console& console, const std::string& out, const PartsArgs& args, const film::Programs& programs,
                 FilmContent& content, std::vector<std::string>& notes);

}  // namespace nodal::host
