// `nodal stitch` with heads whose film is in several files: chapters, and folders of pictures.
#include "film_command.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

class FilmFiles : public FilmCommand {
 protected:
  const Words kHow{"--codec", "ffv1", "--seams", "fixed", "--width", "128"};
  static constexpr int kFrames = 18;

  std::string stitched(const std::string& out, const Words& more = {}) const {
    Words words = kHow;
    words.insert(words.end(), more.begin(), more.end());
    expect_good(stitch(out, words));
    return pixels(path(out), "rgb24");
  }
  /// Chapters of six frames of each head's film: GX010000.mkv, GX020000.mkv, ... of head 0, in `folder`.
  std::string chapter(std::size_t head, int number, const std::string& folder = ".") const {
    return path(folder + "/GX0" + std::to_string(number) + "000" + std::to_string(head) + ".mkv");
  }
  void write_chapters(const std::string& folder = ".") {
    fs::create_directories(path(folder));
    for (std::size_t h = 0; h < films_.size(); ++h) {
      for (int n = 1; n <= 3; ++n) {
        ffmpeg({"-i", films_[h], "-vf",
                "trim=start_frame=" + std::to_string(6 * (n - 1)) + ":end_frame=" + std::to_string(6 * n) +
                    ",setpts=PTS-STARTPTS",
                "-c:v", "ffv1", chapter(h, n, folder)});
      }
    }
  }
};

TEST_F(FilmFiles, Chapters_AreOneFilmInTheOrderOfTheirNumbers) {
  write_films(kFrames, ".mkv", kLossless);
  const std::string whole = stitched("whole.mkv");
  ASSERT_EQ(whole.size(), static_cast<std::size_t>(kFrames) * 128 * 64 * 3);
  write_chapters();
  const std::size_t heads = films_.size();
  films_.clear();
  for (std::size_t h = 0; h < heads; ++h) films_.push_back(chapter(h, 1));
  for (std::size_t h = 0; h < heads; ++h) films_.push_back(chapter(h, 3));
  for (std::size_t h = 0; h < heads; ++h) films_.push_back(chapter(h, 2));
  EXPECT_TRUE(stitched("chapters.mkv") == whole);
  EXPECT_TRUE(parts("chapters.mkv").empty());
  Words shard = kHow;
  shard.insert(shard.end(), {"--segments", "0"});
  expect_good(stitch("shard.mkv", shard));
  shard = kHow;
  shard.emplace_back("--join");
  expect_good(stitch("shard.mkv", shard));
  EXPECT_TRUE(read("shard.mkv") == read("chapters.mkv"));

  const Words all = films_;
  std::erase(films_, chapter(3, 2));
  expect_no_film(stitch("s.mkv", kHow), "GX030003.mkv: at least one file is missing between it and GX010003.mkv",
                 "s.mkv");
  films_ = all;
  ffmpeg({"-i", chapter(4, 2), "-vf", "scale=80:80", "-c:v", "ffv1", path("small.mkv")});
  fs::rename(path("small.mkv"), chapter(4, 2));
  expect_no_film(stitch("s.mkv", kHow), "GX020004.mkv: its pictures are 80x80", "s.mkv");
  write("list.ffconcat", "ffconcat version 1.0\nfile " + chapter(0, 1) + "\n");
  films_ = {path("list.ffconcat")};
  expect_no_film(stitch("s.mkv", kHow), "list.ffconcat: it is no film but a list", "s.mkv");
}

TEST_F(FilmFiles, FoldersOfPicturesOrChapters_AreAHeadEach) {
  write_films(kFrames, ".mkv", kLossless);
  const std::string whole = stitched("whole.mkv");
  write_chapters("all");
  const Words films = films_;
  films_.clear();
  for (std::size_t h = 0; h < films.size(); ++h) {
    fs::create_directories(path("pictures/" + name_of(h)));
    ffmpeg({"-i", films[h], "-pix_fmt", "rgb24", path("pictures/" + name_of(h) + "/f%04d.png")});
    films_.push_back(path("pictures/" + name_of(h)));
  }
  EXPECT_TRUE(stitched("pictures.mkv") == whole);
  EXPECT_NE(ffprobe("stream=r_frame_rate", path("pictures.mkv")).find("=30/1"), std::string::npos);
  EXPECT_TRUE(stitched("slow.mkv", {"--rate", "10"}) == whole);
  EXPECT_NE(ffprobe("stream=r_frame_rate", path("slow.mkv")).find("=10/1"), std::string::npos);
  const std::string third = films_[2] + "/f0007.png";
  test::write_bytes(third, test::png_of(std::vector<std::uint8_t>(80 * 80 * 3), 80, 80, 3));
  expect_no_film(stitch("s.mkv", kHow), "f0007.png: it has 80x80 pixels", "s.mkv");
  fs::remove(third);
  expect_no_film(stitch("s.mkv", kHow), "f0008.png: at least one file is missing between it and f0006.png", "s.mkv");
  fs::create_directories(path("empty"));
  films_[2] = path("empty");
  expect_no_film(stitch("s.mkv", kHow), "empty: the folder has no films and no pictures", "s.mkv");

  films_.clear();
  for (std::size_t h = 0; h < films.size(); ++h) {
    fs::create_directories(path("chapters/" + name_of(h)));
    for (int n = 1; n <= 3; ++n) {
      fs::rename(chapter(h, n, "all"), path("chapters/" + name_of(h) + "/clip_" + std::to_string(n) + ".mkv"));
    }
    films_.push_back(path("chapters/" + name_of(h)));
  }
  EXPECT_TRUE(stitched("folders.mkv") == whole);
}

}  // namespace
}  // namespace nodal::command_line
