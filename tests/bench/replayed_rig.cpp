#include "tests/bench/replayed_rig.h"

#include <turbojpeg.h>

#include <stdexcept>

namespace nodal::bench {
namespace {

/// A packed I420 picture as a JPEG; 4:2:2 has every chroma row twice.
std::vector<std::uint8_t> jpeg_of(const ImageView& picture, bool all_chroma_rows, int quality) {
  std::vector<std::uint8_t> doubled;
  std::array<const unsigned char*, 3> planes{picture.planes[0].data, picture.planes[1].data, picture.planes[2].data};
  const int width = picture.planes[1].width;
  if (all_chroma_rows) {
    for (std::size_t c = 1; c < 3; ++c) {
      for (int y = 0; y < picture.height; ++y) {
        const std::uint8_t* const row = picture.planes[c].data + y / 2 * picture.planes[c].row_stride;
        doubled.insert(doubled.end(), row, row + width);
      }
    }
    planes[1] = doubled.data();
    planes[2] = doubled.data() + doubled.size() / 2;
  }
  const std::array<int, 3> strides{picture.width, width, width};
  const tjhandle coder = tjInitCompress();
  unsigned char* jpeg = nullptr;
  unsigned long bytes = 0;
  const int failed = tjCompressFromYUVPlanes(coder, planes.data(), picture.width, strides.data(), picture.height,
                                             all_chroma_rows ? TJSAMP_422 : TJSAMP_420, &jpeg, &bytes, quality, 0);
  if (failed != 0) throw std::runtime_error(tjGetErrorStr2(coder));
  std::vector<std::uint8_t> made(jpeg, jpeg + bytes);
  tjFree(jpeg);
  tjDestroy(coder);
  return made;
}

}  // namespace

ReplayedRig::ReplayedRig(const Workload& work, PixelFormat format, bool all_chroma_rows, const std::string& rate)
    : work_(work) {
  std::string toml = "[rig]\nname = \"" + work.name + "\"\nrate = \"" + rate +
                     "\"\n[raymap]\nwidth = " + std::to_string(work.raymap.width) +
                     "\nheight = " + std::to_string(work.raymap.height) +
                     "\n[trigger]\nstart = true\n[links]\nunix = \"sock\"\n[store]\nfolder = \"store\"\n";
  const FilmedSet set = film(work.rig, PixelFormat::kI420, 1);
  for (std::size_t h = 0; h < set.heads.size(); ++h) {
    const std::string& name = work.rig.heads[h].name;
    const std::vector<std::uint8_t> jpeg =
        jpeg_of(set.heads[h], all_chroma_rows, format == PixelFormat::kMjpeg ? 85 : 95);
    test::write_bytes(folder_ / (name + ".jpg"), jpeg);
    toml += "[[heads]]\nname = \"" + name + "\"\nport = \"replay:" + name + ".jpg\"\nformat = \"" +
            std::string(pixel_format_name(format)) + "\"\n";
    picture_bytes_ += format == PixelFormat::kMjpeg ? jpeg.size() : set.memory[h].size();
  }
  write("rig.toml", toml);
}

void ReplayedRig::write(const std::string& name, const std::string& text) {
  test::write_bytes(folder_ / name, std::vector<std::uint8_t>(text.begin(), text.end()));
}

std::unique_ptr<test::Process> ReplayedRig::start() {
  auto daemon = std::make_unique<test::Process>(std::vector<std::string>{
      NODAL_BIN_DIR "/nodald", "--config", (folder_ / "rig.toml").string(), "--blend-threads", "2"});
  const bool up = test::wait_until([&] { return test::Process(command({"status"})).wait().code == 0; });
  if (!up) throw std::runtime_error("nodald does not start: " + daemon->complained());
  return daemon;
}

std::vector<std::string> ReplayedRig::command(std::vector<std::string> words) const {
  words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--rig", "unix:" + (folder_ / "sock").string()});
  return words;
}

std::string ReplayedRig::nodal(std::vector<std::string> words) {
  const test::Finished done = test::Process(command(std::move(words))).wait(std::chrono::seconds(120));
  if (done.code != 0) throw std::runtime_error(done.err);
  return done.out;
}

void ReplayedRig::upload(const std::string& name) {
  Calibration calibration = work_.rig;
  calibration.name = name;
  write("rig.json", to_json(calibration));
  nodal({"calibration", "upload", (folder_ / "rig.json").string()});
}

}  // namespace nodal::bench
