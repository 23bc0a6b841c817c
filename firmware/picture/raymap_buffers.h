// The pixels of raymaps that the blend makes.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "firmware/frame/raymap.h"
#include "protocol/base/image.h"
#include "protocol/base/raymap_config.h"

namespace nodal::firmware {

/// Lends a buffer for each raymap of a set. The pool's first round allocates; later ones use buffers that came back.
///
/// Threading: thread-bound to who coordinates the blend; buffers come back from any thread.
class RaymapBuffers {
 public:
  RaymapBuffers(const RaymapConfig& config, std::size_t count)
      : bytes_(packed_size(config.format, config.width, config.height)), pool_(count) {}

  /// Takes a buffer for each raymap of a set, 1 or 2; false when the pool has too few.
  bool reserve(std::size_t raymaps) {
    for (std::size_t i = 0; i < raymaps; ++i) {
      if (reserved_[i]) continue;  // an earlier set took it, when the pool had no second buffer
      reserved_[i] = pool_.take();
      if (!reserved_[i]) return false;
      if (reserved_[i]->empty()) reserved_[i].edit().resize(bytes_);  // it was never used before
    }
    return true;
  }
  /// The buffer that was reserved for the set's raymap `index`.
  PixelsLoan take(std::size_t index) { return std::exchange(reserved_[index], {}); }

 private:
  std::size_t bytes_;
  LoanPool<LineVector> pool_;
  std::array<PixelsLoan, 2> reserved_;
};

}  // namespace nodal::firmware
