// A rig whose heads play image files: one file is repeated every frame; a folder or a pattern such as
// "pictures/cam0-*.png" is played in the order of its names, in a loop.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/replay/picture_reader.h"
#include "hal/trigger.h"
#include "protocol/base/field.h"

namespace nodal::hal::replay {

struct DeckOptions {
  PictureReader pictures;  ///< needed to open a head
  FrameRate rate;
  std::filesystem::path base;               ///< relative paths of heads count from here
  int buffers = 4;                          ///< a head's; a consumer that holds all of them loses frames
  std::uint64_t keep_bytes = 256ULL << 20;  ///< pictures of a head that stay decoded in memory
};

/// A head's exposure, gain and white balance are those of the pictures: its limits are fixed.
///
/// Threading: thread-bound to capture.
/// Ownership: the clock outlives it; heads must be gone before it is.
/// Errors: as the ports. A picture that turns out broken while playing is a frame with kCorrupt.
class Deck {
 public:
  Deck(ClockPort& clock, const DeckOptions& options);
  ~Deck();

  /// Pulses that step all heads that were started with kExternal: picture n goes with pulse n. Heads in free run
  /// play on the clock's own grid of frame times, so they too are in step with each other.
  TriggerPort& trigger();

  /// Paths are "replay:" and a file, folder or pattern. open() reads every picture's header and decodes the first.
  /// Errors: kNoSuchDevice when nothing is there, kBusy when that path is open, and the reader's; kBadValue
  ///   when pictures of one head differ in size. list() knows the paths that were opened or asked a format of.
  HeadEnumerator& enumerator();

  /// Sets the format of the head at `path`; without it, the format of its first picture.
  void want_format(const std::string& path, PixelFormat format);
  /// Sets the fields of its pictures; without it, they are progressive. Call it before the head is opened.
  void want_fields(const std::string& path, Fields fields);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nodal::hal::replay
