// Drive `endotwin run` from C++11 on any POSIX system; no library but the standard one.
//
//     endotwin::Estimator estimator({"endotwin", "run", "--policy", "runs/ram_twins/policy.onnx"});
//     endotwin::Reading reading = estimator.push(0.1, 0.2, 1.3);  // s, mm, deg; NaN: missing
#pragma once
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fcntl.h>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace endotwin {
struct Reading {
    double bend_deg, low_deg, high_deg; // 95 % interval; NaN where it is unknown
    bool trusted;                       // by the trained estimator, from a sample without a fault
};
class Estimator {
public:
    explicit Estimator(const std::vector<std::string> &command) {
        int down[2], up[2];
        std::vector<char *> words;
        for (const std::string &word : command) words.push_back(const_cast<char *>(word.c_str()));
        words.push_back(nullptr);
        std::signal(SIGPIPE, SIG_IGN); // push throws instead
        if (pipe(down) != 0 || pipe(up) != 0) throw std::runtime_error("no pipe");
        for (int end : {down[0], down[1], up[0], up[1]}) fcntl(end, F_SETFD, FD_CLOEXEC);
        if ((child_ = fork()) == 0) {
            dup2(down[0], STDIN_FILENO), dup2(up[1], STDOUT_FILENO);
            execvp(words[0], words.data());
            _exit(127);
        }
        ::close(down[0]), ::close(up[1]);
        to_ = fdopen(down[1], "w"), from_ = fdopen(up[0], "r");
    }
    Estimator(const Estimator &) = delete;
    ~Estimator() { close(); }
    // Answer one sample; throws if its line is refused, or the command has ended.
    Reading push(double time_s, double pull_mm, double measurement_deg) {
        std::ostringstream text;
        text.imbue(std::locale::classic()); // a decimal point, whatever the locale
        text.precision(17);                 // keeps every bit
        text << "{\"time_s\":" << time_s;
        if (std::isfinite(pull_mm)) text << ",\"pull_mm\":" << pull_mm;
        if (std::isfinite(measurement_deg)) text << ",\"measurement_deg\":" << measurement_deg;
        std::fputs((text.str() + "}\n").c_str(), to_), std::fflush(to_);
        std::string line;
        for (int c; (c = std::fgetc(from_)) != '\n'; line += static_cast<char>(c))
            if (c == EOF) throw std::runtime_error("the command has ended");
        if (has(line, "{\"error\":")) throw std::runtime_error(line);
        const bool trusted = has(line, "\"source\":\"advanced\"") && has(line, "\"sample\":[]");
        const std::string interval = line.substr(std::min(line.size(), line.find("\"interval_deg\":[")));
        return {number(line, "\"bend_deg\":"), number(interval, "["), number(interval, ","), trusted};
    }
    // End the stream, so that its recording is complete; returns the exit status of the command.
    int close() {
        int status = 0;
        if (to_ == nullptr) return 0;
        std::fclose(to_), std::fclose(from_), to_ = nullptr;
        return waitpid(child_, &status, 0) < 0 || !WIFEXITED(status) ? 1 : WEXITSTATUS(status);
    }
private:
    static bool has(const std::string &line, const char *part) { return line.find(part) != line.npos; }
    static double number(const std::string &line, const std::string &key) {
        std::istringstream text(has(line, key.c_str()) ? line.substr(line.find(key) + key.size()) : "");
        text.imbue(std::locale::classic());
        double value;
        return text >> value ? value : std::nan("");
    }
    std::FILE *to_ = nullptr, *from_ = nullptr;
    pid_t child_ = -1;
};
} // namespace endotwin
