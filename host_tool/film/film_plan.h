// The plan of a film: everything that decides its bytes. Any part of the film is rendered from the plan alone, so one
// process, many, and one that was stopped and started again make the same film.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/film/codec.h"
#include "host_tool/film/film_file.h"
#include "host_tool/film/film_json.h"
#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/base/stops.h"
#include "protocol/calibration.h"

namespace nodal::film {

/// How a head's clock runs: what happens at the time t of the rig, which is 0 at the first frame of a head with offset
/// 0, is in this head's film at t + offset_s + t * ppm / 10^6 seconds after its first frame.
struct HeadTime {
  std::string head;
  double offset_s = 0;
  double ppm = 0;
  double sigma_s = 0;    ///< standard deviation over the film, where the clock was found
  double ppm_sigma = 0;  ///< the rate's
  std::string by{};      ///< "sound and rotation", "--offset" or "reference": what it was found in; empty: assumed
};

/// "cam3=-0.0417" or "cam3=1.25,43". Errors: kBadValue.
Result<HeadTime> parse_head_time(const std::string& text);

/// How a film is to be.
struct FilmLook {
  RaymapConfig raymap;  ///< heads' films: the pixel format is chosen by the plan
  std::optional<Codec> codec;
  int quality = -1;
  std::string preset;
  Container container = Container::kMp4;
  bool preview = false;  ///< kPreviewFrames frames at most, one in N, at the times that they have in the film
};

/// Brightness of heads whose exposures drift apart.
struct PlannedLight {
  std::vector<std::uint64_t> frames;      ///< numbers of the frames of the result that it was measured in, rising
  std::vector<std::vector<Stops>> stops;  ///< by head: how much more light it recorded than the mean of the heads

  /// In between, it changes evenly.
  Stops at(std::size_t head, std::uint64_t frame) const;
};

/// What a user asks for. Two runs with the same request make the same film.
struct FilmRequest : FilmLook {
  Calibration calibration;         ///< heads in the order of the films
  std::vector<std::string> films;  ///< absolute paths
  bool one_file = false;           ///< all heads are tracks of one file, which `films` repeats
  std::vector<HeadTime> times;     ///< heads that are not named have no offset, or `times_by` finds it
  std::string times_by = "auto";   ///< or "begin", or sources: how other heads' times are found
  double readout_s = 0;            ///< readout of the heads' sensors, used for flashes; 0: not known
  bool matched = true;             ///< brightness of heads is matched
  std::string sound = "auto";      ///< or "none", a head, or a file's absolute path
};

/// The request in words, with what identifies its files. Errors: those of reading the films.
Result<Json> words_of(const FilmRequest& request, const Programs& programs);
/// Name, size, and a hash of both ends of a file, or of all of a list. Errors: those of the disk.
Result<Json> identity_of(const std::string& path);
/// Adds the programs' versions and how the film is to be.
void add_words(Json& words, const FilmLook& look, const Programs& programs);

struct PlannedHead {
  std::string name;
  FilmFile film;                    ///< with one time only, of its first frame
  std::vector<std::int64_t> times;  ///< the time of the head's frame for every frame of the result
  double farthest_s = 0;            ///< how far that is from the wanted instant, at most
  HeadTime clock{};                 ///< offset and rate of the head's clock, with their errors
};

/// A take whose raymaps are shown.
struct PlannedTake {
  std::string folder;                 ///< as messages name it
  std::vector<std::string> heads;     ///< names
  std::vector<std::int64_t> raymaps;  ///< number of the take's raymap for every frame of the result
  double farthest_s = 0;              ///< how far its exposure is from the wanted instant, at most
};

struct PlannedSound {
  std::string path;
  std::string codec;
  double from_s = 0;  ///< when the result begins, in that file's own time
  double ppm = 0;     ///< how much faster that clock runs than the result's
};

struct PlannedSeams {
  std::uint64_t segment = 0;         ///< the first one that has them
  std::vector<std::uint8_t> labels;  ///< on the map of sets::kSeamMapWidth columns
};

struct FilmPlan {
  static constexpr std::uint64_t kSegmentFrames = 240;
  static constexpr std::int64_t kMaxFrames = 1 << 24;  ///< 155 hours at 30 frames a second

  Json request;             ///< words_of()
  Calibration calibration;  ///< heads' films
  RaymapConfig raymap;
  Coding coding;
  Container container = Container::kMp4;
  std::vector<PlannedHead> heads;   ///< empty: `take`
  std::optional<PlannedTake> take;  ///< whose own documents say how it is blended
  std::optional<PlannedSound> sound;
  std::uint64_t frames = 0;
  double times_residual_s = 0;      ///< difference between the lags of pairs of heads and the result, root mean square
  PlannedLight light;               ///< empty: heads are as bright as the calibration says
  std::vector<PlannedSeams> seams;  ///< ordered by frame; empty: the calibration's own seams
  std::string id;                   ///< hash of the plan; set by id_of() or read_plan()

  std::uint64_t segments() const { return (frames + kSegmentFrames - 1) / kSegmentFrames; }
  std::uint64_t begin_of(std::uint64_t segment) const { return segment * kSegmentFrames; }
  std::uint64_t end_of(std::uint64_t segment) const { return std::min(frames, begin_of(segment + 1)); }
  /// The seams in force; null: the calibration's own.
  const PlannedSeams* seams_at(std::uint64_t segment) const;
};

/// The plan without placed seams: which frame of every head is shown when, and where the sound is from. `notes`: whole
/// sentences for the user.
/// Errors: kBadValue for films that have no time in common, and for a head or file that --offset or --sound name and
/// that is not there; those of check().
Result<FilmPlan> make_plan(const FilmRequest& request, const std::vector<FilmFile>& films, const Programs& programs,
                           std::vector<std::string>& notes);

/// The plan as a document, without `id`; the same text for the same plan.
std::string to_text(const FilmPlan& plan);
/// Errors: kBadFormat, kFutureVersion, kBadValue.
Result<FilmPlan> plan_of(const std::string& text);
/// The largest document that is read.
inline constexpr std::size_t kMaxPlanBytes = std::size_t{512} << 20;

}  // namespace nodal::film
