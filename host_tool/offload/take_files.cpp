#include "host_tool/offload/take_files.h"

#include <fmt/format.h>

#include <utility>

#include "host_tool/offload/local_file.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

class FileHere final : public media::TakeFile {
 public:
  FileHere(LocalFile file, std::string shown, std::uint64_t size)
      : file_(std::move(file)), shown_(std::move(shown)), size_(size) {}

  std::uint64_t size() const override { return size_; }
  Status read(std::uint64_t at, std::span<std::uint8_t> bytes) override {
    NODAL_TRY_ASSIGN(const std::size_t got, file_.read(at, bytes));
    if (got < bytes.size()) return fail(Errc::kTruncated, fmt::format("{}: ends at byte {}", shown_, at + got));
    return {};
  }

 private:
  LocalFile file_;
  std::string shown_;
  std::uint64_t size_;
};

class FolderHere final : public media::TakeFiles {
 public:
  explicit FolderHere(std::filesystem::path folder) : folder_(std::move(folder)) {}

  Result<std::unique_ptr<media::TakeFile>> open(const std::string& name) override {
    NODAL_TRY_ASSIGN(LocalFile file, LocalFile::open_to_read(folder_ / name));
    NODAL_TRY_ASSIGN(const std::uint64_t size, file.size());
    return std::make_unique<FileHere>(std::move(file), shown(name), size);
  }
  std::string shown(const std::string& name) const override {
    return name.empty() ? folder_.string() : (folder_ / name).string();
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace

std::shared_ptr<media::TakeFiles> take_files(const std::filesystem::path& folder) {
  return std::make_shared<FolderHere>(folder);
}

}  // namespace nodal::host
