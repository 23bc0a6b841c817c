// Segments of a film: parts of the plan that are rendered one by one, on any machine, in any order.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/film/film_json.h"
#include "host_tool/film/film_plan.h"
#include "host_tool/film/frame_source.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// The folder of a film that is being made: the plan, and the segments that are whole.
struct PartsFolder {
  std::string path;  ///< "sphere.mp4.parts"

  std::string plan_file() const { return path + "/plan.json"; }
  /// Named after the plan too, so that one of another plan is never taken for it.
  std::string segment_file(const FilmPlan& plan, std::uint64_t segment) const;
  /// Whether the segment is there and whole, as its record says, which is written after it.
  bool has(const FilmPlan& plan, std::uint64_t segment) const;
};
PartsFolder parts_of(const std::string& out);

/// Writes the plan, unless it is there, and returns it as it is stored. Errors: kWrongState if there is one of another
/// request; those of the disk.
Result<FilmPlan> store_plan(const PartsFolder& parts, const FilmPlan& plan);
/// The plan in the folder if there is one; nothing if not. `request`: its words_of().
/// Errors: kWrongState, with what differs, if it is for another request; those of plan_of().
Result<std::optional<FilmPlan>> stored_plan(const PartsFolder& parts, const Json& request);

/// Tells how far it is: frames that are done of the whole work. Returns false to stop.
using FilmProgress = std::function<bool(std::uint64_t frames)>;

/// Places the seams of every segment, by the first frame of each. Errors: those of the source; kCancelled.
Status plan_seams(FilmPlan& plan, FrameSource& source, const FilmProgress& progress);

struct RenderedSegment {
  std::vector<std::string> notes;  ///< whole sentences for the user
};
/// Renders a segment into the folder: under a name of this attempt, which is renamed when it is whole and on disk.
/// Errors: those of the source and of the encoder; kCancelled; kDiskFull.
Result<RenderedSegment> render_segment(const FilmPlan& plan, std::uint64_t segment, const PartsFolder& parts,
                                       FrameSource& source, const Programs& programs, const FilmProgress& progress);

}  // namespace nodal::film
