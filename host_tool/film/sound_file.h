// A reduced sound in a file without a name: memory does not grow with the film, and nothing is left behind.
#pragma once

#include <memory>
#include <string>

#include "stitch/timing/sound_store.h"

namespace nodal::film {

/// 16 bits a sample: 72 MB an hour. Samples are -1 .. 1; 0 stays 0 and means silence; nothing else becomes 0.
///
/// Threading: as SoundStore.
/// Errors: kDiskFull, kIo, naming the folder.
class SoundFile final : public timing::SoundStore {
 public:
  static Result<std::shared_ptr<timing::SoundStore>> make(const std::string& folder);
  SoundFile(int descriptor, std::string folder) : descriptor_(descriptor), folder_(std::move(folder)) {}
  ~SoundFile() override;

  Status append(std::span<const float> samples) override;
  Status read(std::int64_t first, std::span<float> into) const override;

 private:
  Error failed(int error) const;

  int descriptor_;
  std::string folder_;
};

}  // namespace nodal::film
