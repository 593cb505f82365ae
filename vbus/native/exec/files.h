/* files.h - see files.c. License: Apache-2.0. */
#ifndef VBUS_EXEC_FILES_H
#define VBUS_EXEC_FILES_H

/* Whether a descriptor is /dev/uio0 with an interrupt, and whether one has come. */
int files_uio(int fd);
int files_uio_ready(void);

/* Descriptors have been closed, or one copied (returns `to`). */
void files_closed(unsigned first, unsigned last);
int files_copied(int from, int to);

#endif
