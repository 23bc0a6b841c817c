// A rig whose heads play image files: one file is repeated every frame; a folder or a pattern such as
// "pictures/cam0-*.png" is played in name order, in a loop. Or they play the frames of a take, with its settings and
// losses.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/replay/picture_reader.h"
#include "hal/replay/reel.h"
#include "hal/trigger.h"
#include "protocol/base/field.h"

namespace nodal::hal::replay {

struct DeckOptions {
  PictureReader pictures;  ///< required to open a head
  /// Opens the frames of a head of a take; required for heads on "take:".
  std::function<Result<std::unique_ptr<Reel>>(const std::filesystem::path& folder, const std::string& head)> takes;
  /// Called when a head is opened, once for each sentence about files that are not played; may be empty.
  std::function<void(const std::string& sentence)> note{};
  FrameRate rate;
  std::filesystem::path base;               ///< base of heads' relative paths
  int buffers = 4;                          ///< per head; a consumer that holds all of them loses frames
  std::uint64_t keep_bytes = 256ULL << 20;  ///< limit of decoded pictures kept in memory, per head
};

/// A head's exposure, gain and white balance are those of the pictures, so its limits are fixed values. Where a take
/// has no frame of the head, none comes, and the counter of its frames has a gap.
///
/// Threading: thread-bound to capture.
/// Ownership: refers to the clock; destroy heads first.
/// Errors: as the ports. A picture that cannot be decoded during playback is a frame with kCorrupt.
class Deck {
 public:
  Deck(ClockPort& clock, const DeckOptions& options);
  ~Deck();

  /// Pulses that step all heads that were started with kExternal: picture n belongs to pulse n. Heads in free run play
  /// on the clock's grid of frame times, so they are in step with each other too. Wired heads play the pulses while the
  /// trigger runs, and otherwise the grid.
  TriggerPort& trigger();

  /// A path is "replay:" and a file, folder or pattern; or "take:", the folder of a take, "/" and the name of a head.
  /// open() reads every picture's header and decodes the first.
  /// Errors: kNoSuchDevice if nothing is there, kBusy if that path is open, those of the reader, and kBadValue if
  ///   pictures of one head differ in size, or if a take has another format, other fields or another rate than is
  ///   wanted. list() contains the paths that were opened or for which a format was set.
  HeadEnumerator& enumerator();

  /// Sets the format of the head at `path`; the default is the format of its first picture.
  void want_format(const std::string& path, PixelFormat format);
  /// Sets the fields of its pictures; the default is progressive. Call it before the head is opened.
  void want_fields(const std::string& path, Fields fields);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nodal::hal::replay
