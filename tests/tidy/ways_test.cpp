// The one way to do some things: opening files, making threads, emptying queues, wording messages.
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <string>
#include <vector>

#include "functions.h"
#include "tree.h"

namespace nodal::tidy {
namespace {

struct Found {
  std::string place;  ///< "hal/linux/disk.cpp:73"
  std::string path;
  std::string text;  ///< the line, after the one before it
};

/// Lines of code that match, in the folders of the programs.
std::vector<Found> lines_with(const std::regex& what, const std::vector<std::string>& folders) {
  std::vector<Found> found;
  for (const TextFile& file : project_files()) {
    const bool ours = std::ranges::any_of(folders, [&](const auto& folder) { return file.path.starts_with(folder); });
    if (!ours || !is_source(file.path)) continue;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      const std::string code = file.lines[i].substr(0, file.lines[i].find("//"));
      if (std::regex_search(code, what))
        found.push_back({file.path + ":" + std::to_string(i + 1), file.path, (i > 0 ? file.lines[i - 1] : "") + code});
    }
  }
  return found;
}

bool is_one_of(const std::string& path, const std::vector<std::string>& allowed) {
  return std::ranges::find(allowed, path) != allowed.end();
}

const std::vector<std::string> kPrograms{"firmware/", "hal/", "host_tool/", "protocol/", "stitch/"};

TEST(Ways, ABufferedFile_IsOpenedByProtocolFilesOnly) {
  const std::regex streams(R"(\b(fopen|freopen)\s*\(|\b(i|o)?fstream\b|\bfilebuf\b)");
  for (const Found& found : lines_with(streams, kPrograms)) {
    ADD_FAILURE() << found.place
                  << " opens a file by itself, which waits for ever if it is a FIFO; use open_to_read() or "
                  << "create_to_write() of protocol/files/open_file.h";
  }
}

TEST(Ways, ADescriptor_IsOpenedByPortsOnlyAndNeverWaits) {
  // What opens a device, a folder that it keeps, or a file without following links.
  const std::vector<std::string> ports{"protocol/files/open_file.cpp",
                                       "host_tool/offload/local_file.cpp",
                                       "host_tool/web/devices.cpp",
                                       "host_tool/child/child.cpp",
                                       "hal/linux/disk.cpp",
                                       "hal/linux/disk_folder.cpp",
                                       "firmware/daemon/confined_work.cpp",
                                       "hal/linux/confine/confine.cpp",
                                       "hal/linux/confine/confined_process.cpp",
                                       "hal/linux/v4l2/system.cpp",
                                       "hal/linux/cable/function_fs.cpp",
                                       "hal/linux/link/link_helper.cpp",
                                       "hal/linux/link/socket_link.cpp",
                                       "hal/linux/link/standard_descriptors.cpp"};
  const std::regex opens(R"((^|[^A-Za-z0-9_])::(open|openat|creat)\s*\()");
  const std::regex no_wait(R"(O_NONBLOCK|O_DIRECTORY|O_PATH|"/dev/null"|"/proc/self/)");
  for (const Found& found : lines_with(opens, kPrograms)) {
    EXPECT_TRUE(is_one_of(found.path, ports)) << found.place << ": use protocol/files/open_file.h";
    EXPECT_TRUE(std::regex_search(found.text, no_wait)) << found.place << " may wait: add O_NONBLOCK";
  }
}

TEST(Ways, AThreadOnBoard_HasAHeartbeat) {
  const std::vector<std::string> maker{"hal/linux/thread/thread.h", "hal/linux/thread/thread.cpp"};
  const std::regex threads(
      R"(\bstd::(jthread|async)\b|\bstd::thread\b(?!::hardware_concurrency)|\bpthread_create\b|\bthrd_create\b)");
  for (const Found& found : lines_with(threads, {"firmware/", "hal/"})) {
    EXPECT_TRUE(is_one_of(found.path, maker)) << found.place << ": make a hal::Thread (hal/linux/thread/thread.h)";
  }
}

TEST(Ways, AStepOnBoard_TakesWhatAQueueHoldsAndEnds) {
  // A file has an end; a failed exchange means that another thread made progress; an outlet gets a few items a period.
  const std::vector<std::string> ends{"firmware/storage/file_pieces.cpp", "firmware/frame/outlet.h"};
  const std::regex endless(R"(\bwhile \(.*(\.|->)(pop|take|take_edge)\(\)|\bwhile \(true\)|\bfor \(;;\))");
  for (const Found& found : lines_with(endless, {"firmware/"})) {
    if (found.path.starts_with("firmware/daemon/")) continue;  // threads and the start, not steps
    EXPECT_TRUE(is_one_of(found.path, ends))
        << found.place
        << " goes on for as long as another thread pushes; use drain() (firmware/frame/drain.h), or count";
  }
}

TEST(Ways, AnErrorThatIsOnlyPassedOn_IsPassedOnByNodalTry) {
  const std::regex by_hand(
      R"(if \((?:const )?(?:Status|auto|Result<.*>) (\w+) = .*; !\1\) return (?:fail\(\1\.error\(\)\)|\1);)");
  for (const Found& found : lines_with(by_hand, kPrograms)) {
    ADD_FAILURE() << found.place << " passes an error on by hand; use NODAL_TRY() of protocol/base/try.h";
  }
}

/// Lines on which a number is written by std::to_string() and joined to other text by +.
std::vector<std::size_t> numbers_joined_in(const TextFile& file) {
  const std::string text = brackets_of(file);
  const auto is_plus = [&text](std::size_t at, std::size_t beside) {
    return at != std::string::npos && text[at] == '+' && beside < text.size() && text[beside] != '+';
  };
  std::vector<std::size_t> lines;
  const std::string call = "std::to_string(";
  for (std::size_t at = text.find(call); at != std::string::npos; at = text.find(call, at + 1)) {
    std::size_t end = at + call.size();
    for (int open = 1; open > 0 && end < text.size(); ++end) open += text[end] == '(' ? 1 : text[end] == ')' ? -1 : 0;
    const std::size_t before = at == 0 ? std::string::npos : text.find_last_not_of(" \n", at - 1);
    const std::size_t after = text.find_first_not_of(" \n", end);
    if (is_plus(before, before - 1) || is_plus(after, after + 1)) {
      lines.push_back(1 +
                      static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<long>(at), '\n')));
    }
  }
  return lines;
}

TEST(Ways, AMessage_IsWordedByFmt) {
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path) || file.path.starts_with("tests/")) continue;
    for (const std::size_t line : numbers_joined_in(file)) {
      ADD_FAILURE() << file.path << ":" << line << " joins a number to a text by +; write fmt::format(\"head {}\", n)";
    }
  }
}

TEST(Ways, NumbersJoinedToTexts_AreFoundAndSingleOnesAreNot) {
  const TextFile file{
      "a.cpp",
      {"text = \"head \" + std::to_string(head(1));", "text = std::to_string(head) +", "       \" heads\";",
       "text += std::to_string(head);", "table.row({std::to_string(head), std::to_string(++count)});",
       "text = named ? \"head \" +", "    std::to_string(head) : \"no head\";", "// text + std::to_string(head)"}};
  EXPECT_EQ(numbers_joined_in(file), (std::vector<std::size_t>{1, 2, 7}));
}

}  // namespace
}  // namespace nodal::tidy
