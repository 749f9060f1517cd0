/* Drive `endotwin run` from C99 on any POSIX system; no library but libc and libm.
 *
 *     cc -std=c99 -o run_stream run_stream.c -lm
 *     ./run_stream endotwin run --policy runs/ram_twins/policy.onnx
 *
 * It pulls to and fro, measures with some noise, and prints what comes back. In place of `pull_mm` and
 * `measurement_deg` below, put the command of your drive and the angle of your sensor.
 */
#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#define SAMPLES 100
#define SAMPLE_TIME 0.1 /* [s], that of the training unless --sample-time says another */
#define LONGEST 4096    /* an answer has some two hundred bytes */

/* Start a command; its stdin and stdout become two streams of this program. */
static pid_t start(char **command, FILE **to, FILE **from)
{
    int down[2], up[2];
    pid_t child;

    if (pipe(down) != 0 || pipe(up) != 0 || (child = fork()) < 0) {
        perror("run_stream");
        exit(EXIT_FAILURE);
    }
    if (child == 0) {
        dup2(down[0], STDIN_FILENO);
        dup2(up[1], STDOUT_FILENO);
        close(down[0]), close(down[1]), close(up[0]), close(up[1]);
        execvp(command[0], command);
        perror(command[0]);
        _exit(127);
    }
    close(down[0]), close(up[1]);
    *to = fdopen(down[1], "w");
    *from = fdopen(up[0], "r");
    return child;
}

/* The number behind a key of an answer; NaN where there is none. */
static double number_of(const char *line, const char *key)
{
    const char *found = strstr(line, key);
    char *end;
    double value;

    if (found == NULL)
        return NAN;
    value = strtod(found + strlen(key), &end);
    return end == found + strlen(key) ? NAN : value;
}

int main(int count, char **words)
{
    FILE *to, *from;
    char line[LONGEST];
    int k, status;
    pid_t child;

    if (count < 2) {
        fprintf(stderr, "usage: %s endotwin run --policy FILE [options]\n", words[0]);
        return 2;
    }
    signal(SIGPIPE, SIG_IGN); /* if it ends early, fgets says so below */
    child = start(words + 1, &to, &from);
    for (k = 0; k < SAMPLES; k++) {
        double time_s = SAMPLE_TIME * k;
        double pull_mm = 2.0 * sin(time_s);
        double measurement_deg = 40.0 * sin(time_s - 0.3) + (rand() / (double)RAND_MAX - 0.5);

        /* %.17g keeps every bit. Neither "nan" nor "inf" is JSON: leave out what is not there. */
        fprintf(to, "{\"time_s\":%.17g,\"pull_mm\":%.17g", time_s, pull_mm);
        if (k % 10 != 9)
            fprintf(to, ",\"measurement_deg\":%.17g", measurement_deg);
        fprintf(to, "}\n");
        fflush(to);
        if (fgets(line, sizeof line, from) == NULL) /* exactly one answer for each line */
            break;
        if (strncmp(line, "{\"error\":", 9) == 0)
            fprintf(stderr, "%s", line);
        else
            printf("%6.2f s  %8.3f deg  from %.3f%s%s\n", number_of(line, "\"time_s\":"),
                   number_of(line, "\"bend_deg\":"), number_of(line, "\"interval_deg\":["),
                   strstr(line, "\"source\":\"advanced\"") ? "" : "  not by the trained estimator",
                   strstr(line, "\"sample\":[]") ? "" : "  with a fault");
    }
    fclose(to); /* the end of the stream: it closes its recording, and sums up on stderr */
    fclose(from);
    if (waitpid(child, &status, 0) < 0 || !WIFEXITED(status))
        return EXIT_FAILURE;
    return WEXITSTATUS(status);
}
