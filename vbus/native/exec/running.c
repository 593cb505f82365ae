/* running.c - whether a wait can still be satisfied by what other threads do. License: Apache-2.0.
 *
 * Other threads run in wall time. A wait is in vain when for a moment none of them runs and none has
 * used the card; then the chips' time passes and the wall's does not.
 */
#define _GNU_SOURCE
#include "card.h"
#include "clock.h"
#include "sys.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>

enum others { NONE, ASLEEP, AWAKE };

/* What the other threads of this process do right now. */
static enum others others(void)
{
    int using, still;
    unsigned before = card_entries(&using);
    DIR *folder = opendir("/proc/self/task");
    long self = syscall(SYS_gettid);
    struct dirent *entry;
    enum others found = NONE;

    while (folder != NULL && found != AWAKE && (entry = readdir(folder)) != NULL) {
        char path[64], text[128], *end;
        ssize_t size;
        int fd;

        if (entry->d_name[0] == '.' || atol(entry->d_name) == self)
            continue;
        snprintf(path, sizeof path, "/proc/self/task/%.16s/stat", entry->d_name);
        fd = sys_open(path, O_RDONLY | O_CLOEXEC);
        size = fd < 0 ? 0 : sys_read(fd, text, sizeof text - 1);
        if (fd >= 0)
            sys_close(fd);
        text[size > 0 ? size : 0] = '\0';
        end = strrchr(text, ')');
        found = end != NULL && end[1] == ' ' && (end[2] == 'R' || end[2] == 'D') ? AWAKE : ASLEEP;
    }
    if (folder != NULL)
        closedir(folder);
    /* A thread that waits for the board looks asleep. */
    return card_entries(&still) != before || still > 0 || using > 0 ? AWAKE : found;
}

/* Looks in a row at which all others sleep: one may just be waiting for the kernel. */
#define SOUND_SLEEP 4

void patience_begin(struct patience *patience, int64_t longest)
{
    patience->left = longest;
    patience->waited = 0;
    patience->asleep = 0;
    patience->seen = card_elapsed();
}

int patience_over(struct patience *patience)
{
    uint64_t now = card_elapsed(), gone = now - patience->seen;
    enum others they = others();

    patience->seen = now;
    patience->waited += GRACE_MS * 1000000;
    if (gone > 0 && patience->left > 0)
        patience->left = patience->left > (int64_t)gone ? patience->left - (int64_t)gone : 0;
    if (they == NONE || patience->left == 0)
        return 1;
    patience->asleep = gone > 0 || they == AWAKE ? 0 : patience->asleep + 1;
    if (patience->asleep >= SOUND_SLEEP)
        return 1;
    return patience->waited >= (patience->left < 0 ? NS : patience->left);
}
