#include "limber/core/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "limber/core/error.h"

namespace limber {
namespace {

std::string reason() { return std::strerror(errno); }

/// Owns a POSIX file descriptor.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  /// Closing can be the first to report that the disk is full, so the writer asks for its result.
  bool close() { return ::close(std::exchange(fd_, -1)) == 0; }

 private:
  int fd_;
};

std::filesystem::path temporary_beside(const std::filesystem::path& path) {
  static int counter = 0;
  std::filesystem::path t = path;
  t += ".part" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
  return t;
}

void write_all(const std::filesystem::path& shown, const std::filesystem::path& path, std::string_view bytes) {
  Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (file.get() < 0) throw InputError("write \"" + shown.string() + "\": " + reason());
  const auto fail = [&] {
    const std::string why = reason();
    ::unlink(path.c_str());
    throw InputError("write \"" + shown.string() + "\": " + why + "; nothing was written");
  };
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::write(file.get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail();
    done += static_cast<std::size_t>(n);
  }
  if (!file.close()) fail();
}

}  // namespace

std::string read_file(const std::filesystem::path& path, std::uint64_t max_bytes) {
  const std::string name = "read \"" + path.string() + "\": ";
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.get() < 0) throw InputError(name + reason());
  struct stat info {};
  if (::fstat(file.get(), &info) != 0) throw InputError(name + reason());
  if (S_ISDIR(info.st_mode)) throw InputError(name + "is a directory, expected a file");
  if (!S_ISREG(info.st_mode)) throw InputError(name + "is not a regular file");
  const auto size = static_cast<std::size_t>(info.st_size);
  if (size == 0) throw InputError(name + "the file is empty");
  if (size > max_bytes)
    throw InputError(name + "has " + std::to_string(size) + " bytes, expected at most " + std::to_string(max_bytes));
  std::string bytes(size, '\0');
  std::size_t done = 0;
  while (done < size) {
    const ssize_t n = ::read(file.get(), bytes.data() + done, size - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw InputError(name + reason());
    if (n == 0) throw InputError(name + "ended early, at byte " + std::to_string(done) + " of " + std::to_string(size));
    done += static_cast<std::size_t>(n);
  }
  return bytes;
}

void write_file(const std::filesystem::path& path, std::string_view bytes) {
  OutputFiles files;
  files.add(path, bytes);
  files.commit();
}

OutputFiles::~OutputFiles() {
  for (const Pending& p : pending_) ::unlink(p.temporary.c_str());
}

void OutputFiles::add(const std::filesystem::path& path, std::string_view bytes) {
  std::error_code ignored;
  if (path.empty()) throw InputError("write \"\": the file name is empty");
  if (std::filesystem::is_directory(path, ignored))
    throw InputError("write \"" + path.string() + "\": is a directory, expected a file name");
  // The rename would put a plain file in the place of a device.
  if (std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored))
    throw InputError("write \"" + path.string() + "\": is not a regular file, expected a file name");
  const auto temporary = temporary_beside(path);
  write_all(path, temporary, bytes);
  pending_.push_back({temporary, path});
}

void OutputFiles::commit() {
  while (!pending_.empty()) {
    const Pending p = pending_.back();
    if (::rename(p.temporary.c_str(), p.final.c_str()) != 0)
      throw InputError("write \"" + p.final.string() + "\": " + reason());
    pending_.pop_back();
  }
}

}  // namespace limber
