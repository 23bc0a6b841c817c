// Picture files and folders for tests, written directly by the image libraries.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "protocol/base/image.h"

namespace nodal::test {

/// A temporary folder; the destructor removes it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// RGB24, packed: a smooth picture, different for each `seed`.
std::vector<std::uint8_t> smooth_rgb(int width, int height, int seed = 0);

void write_bytes(const std::filesystem::path& file, const std::vector<std::uint8_t>& bytes);
std::vector<std::uint8_t> read_bytes(const std::filesystem::path& file);

/// `channels`: 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA; `depth`: 8, or 16 with big-endian samples.
std::vector<std::uint8_t> png_of(const std::vector<std::uint8_t>& pixels, int width, int height, int channels,
                                 int depth = 8);
enum class Sampling { k420, k422, k444, kGrey };
std::vector<std::uint8_t> jpeg_of(const std::vector<std::uint8_t>& rgb, int width, int height, Sampling sampling,
                                  int quality = 95);

/// 10 log10(255^2 / mse) over all bytes; 99 for equal pictures.
double psnr(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b);

}  // namespace nodal::test
