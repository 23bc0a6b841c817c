// Where the samples of a reduced sound are kept: in memory, or in a file of the caller's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::timing {

/// Threading: thread-bound while it is written; then any number of threads may read.
/// Errors: those of the place.
class SoundStore {
 public:
  SoundStore() = default;
  SoundStore(const SoundStore&) = delete;
  SoundStore& operator=(const SoundStore&) = delete;
  virtual ~SoundStore() = default;
  virtual Status append(std::span<const float> samples) = 0;
  /// Samples from `first` on; all of them have been appended.
  virtual Status read(std::int64_t first, std::span<float> into) const = 0;
};

/// 144 MB an hour.
class MemoryStore final : public SoundStore {
 public:
  Status append(std::span<const float> samples) override;
  Status read(std::int64_t first, std::span<float> into) const override;

 private:
  std::vector<float> samples_;
};

}  // namespace nodal::timing
